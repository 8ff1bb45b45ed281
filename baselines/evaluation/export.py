"""Joint motions as files for other programs: tables, and messages as ROS 2 tools read them."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.episodes import Episode, Seeds
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, known_names


@dataclasses.dataclass(frozen=True, eq=False)
class Motion:
    """The joint motion of an episode, from its start.

    Args:
        joint_names: What the joints are called.
        units: Of their coordinates, ``"rad"`` or ``"m"``.
        times: From 0, in [s]. Shape (steps + 1,).
        q: Joint coordinates at these times, in [rad] or [m]. Shape (steps + 1, n).
        qdot: Joint velocities applied in the step that ends then, 0 at the start, in [rad/s] or [m/s]. (steps + 1, n).
    """

    joint_names: tuple[str, ...]
    units: tuple[str, ...]
    times: FloatArray
    q: FloatArray
    qdot: FloatArray

    @classmethod
    def of(cls, scenario: Scenario, seeds: Seeds, episode: Episode) -> Motion:
        """The motion of an episode.

        Args:
            scenario: The scenario.
            seeds: Seeds of the episode.
            episode: Its record.
        """
        arm = scenario.arm
        return cls(
            tuple(arm.joint_names),
            tuple("m" if prismatic else "rad" for prismatic in arm.prismatic),
            scenario.times(scenario.steps + 1),
            np.vstack([scenario.start_of(seeds.seed, seeds.arm_seed), episode.q]),
            np.vstack([np.zeros(arm.joints), episode.qdot]),
        )

    def columns(self) -> dict[str, FloatArray]:
        """Times, coordinates and velocities by name and unit."""
        out = {"time [s]": self.times}
        named = list(zip(self.joint_names, self.units, strict=True))
        out |= {f"{name} [{unit}]": self.q[:, j] for j, (name, unit) in enumerate(named)}
        return out | {f"{name} [{unit}/s]": self.qdot[:, j] for j, (name, unit) in enumerate(named)}

    def message(self) -> dict[str, Any]:
        """A `trajectory_msgs/msg/JointTrajectory` with all of its fields.

        The header's time of 0 means at once. Accelerations and efforts are left to whoever plays it: a velocity is that
        of a whole step, and so has none.
        """
        points = zip(self.times.tolist(), self.q.tolist(), self.qdot.tolist(), strict=True)
        return {
            "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
            "joint_names": list(self.joint_names),
            "points": [
                {
                    "positions": q,
                    "velocities": qdot,
                    "accelerations": [],
                    "effort": [],
                    "time_from_start": _duration(time),
                }
                for time, q, qdot in points
            ],
        }


class Format(NamedTuple):
    """A kind of file.

    Attributes:
        suffix: Of its name.
        content: What a motion is written as.
    """

    suffix: str
    content: Callable[[Motion], bytes]


def table(columns: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """Columns as CSV, one line a row; numbers keep all digits, and those that are no numbers are left empty."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for cells in zip(*(values.tolist() for values in columns.values()), strict=True):
        writer.writerow(["" if cell != cell else cell for cell in cells])
    return text.getvalue().encode()


def message(motion: Motion) -> bytes:
    """A motion as JSON, which `ros2 topic pub` and everything that reads YAML takes for a message."""
    return (json.dumps(motion.message(), ensure_ascii=False, allow_nan=False) + "\n").encode()


#: What a motion can be exported as, by name.
FORMATS: Mapping[str, Format] = {
    "csv": Format(".csv", lambda motion: table(motion.columns())),
    "joint-trajectory": Format(".json", message),
}


def formats(names: str | Iterable[str]) -> tuple[str, ...]:
    """The names of formats, each once.

    Raises:
        UnknownNameError: There is no format of a name.
    """
    given = (names,) if isinstance(names, str) else tuple(names)
    known_names("format of export", given, tuple(FORMATS))
    return tuple(dict.fromkeys(given))


def _duration(time: float) -> dict[str, int]:
    """A `builtin_interfaces/msg/Duration`, to the nanosecond."""
    sec, nanosec = divmod(round(1e9 * time), 10**9)
    return {"sec": sec, "nanosec": nanosec}
