"""The tracker of ssik: closed-form inverse kinematics, continued along one branch."""

from __future__ import annotations

import dataclasses
import pathlib
import tempfile
from typing import Any, ClassVar

import numpy as np

from baselines.solvers.rivals.base import WHOLE_POSES, Rival, Seen, Step
from baselines.solvers.rivals.model_files import BASE, TIP, mjcf
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray, number


@dataclasses.dataclass(frozen=True, eq=False)
class Ssik(Rival):
    """The streaming `Tracker` of ssik: the next pose in, the joint coordinates of the same branch out.

    It holds the redundancy coordinate, keeps position limits, and scales its step down, direction kept, to the velocity
    limits; it has none of acceleration. At each step it is set to where the arm stands (`reset`), and is asked for
    the pose Δt later. Where it holds, since the pose is beyond reach or limits or a jump away, the arm is stopped, and
    the status is ``diverged``. The model is handed over as MJCF: an arm of 6 or 7 revolute joints that it has a closed
    form for.

    Args:
        problem: What the policy is told of the scenario.
        jump_threshold: Largest shift of a joint in [rad] that counts as the same branch; its own default. Above 0.

    Raises:
        InvalidInputError: See :class:`Rival`; or the threshold is out of its range.
        MissingDependencyError: ssik is not installed.
    """

    jump_threshold: float = 0.5

    name: ClassVar[str] = "ssik"
    package: ClassVar[str] = "ssik"
    distribution: ClassVar[str] = "ssik"
    tasks: ClassVar[tuple[str, ...]] = WHOLE_POSES

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "jump_threshold", number("jump_threshold", self.jump_threshold, above=0.0))
        model = self.problem.model
        if model.joints not in (6, 7) or any(model.prismatic):
            raise InvalidInputError(
                f"ssik: expected an arm of 6 or 7 revolute joints, got {model.joints - sum(model.prismatic)} revolute "
                f"and {sum(model.prismatic)} prismatic ones."
            )
        if (way := self._manipulator().solver_name).startswith("jointlock"):
            raise InvalidInputError(
                f"ssik: expected an arm that it has a closed form for, got {model.name!r}, which it solves by {way!r}: "
                "one step would take seconds."
            )

    def make_step(self) -> Step:
        """See :meth:`Rival.make_step`."""
        held, dt, pose = self.imported().TrackStatus.HELD, self.problem.dt, np.eye(4)
        model, speed = self.problem.model, np.array(self.problem.largest_qdot)
        start = np.clip(0.0, model.lower, model.upper) if model.home is None else np.array(model.home)
        tracker = self._manipulator().tracker(start, max_joint_speed=speed, jump_threshold=self.jump_threshold)

        def step(seen: Seen) -> FloatArray | None:
            pose[:3, :3], pose[:3, 3] = seen.target
            tracker.reset(seen.q, t=0.0)
            try:
                found = tracker.update(pose, dt)
            except ValueError:  # what it is shown is no rotation
                return None
            if found.status is held:
                return None
            rate: FloatArray = (found.q - seen.q) / dt
            return rate

        return step

    def _manipulator(self) -> Any:
        self.imported("mujoco")  # which reads the file
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "arm.xml"
            file.write_text(mjcf(self.problem.model), encoding="utf-8")
            return self.imported().Manipulator.from_mjcf(file, base=BASE, ee=TIP)
