"""Rows: the scores of one episode, and the machine that it was played on."""

from __future__ import annotations

import collections
import dataclasses
import functools
import math
import pathlib
import platform
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numba
import numpy as np

import ikgym
from baselines.episodes import Episode, Seeds, add_up
from baselines.files import canonical
from baselines.status import Status
from ikgym.arms import Arm
from ikgym.arms.limits import BOUNDS, at_limits
from ikgym.kernels.threads import count_cores
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

if TYPE_CHECKING:
    import pandas as pd

#: Identifies an episode of an evaluation: scenario, policy, its parameters as text, seeds, steps.
Key = tuple[str, str, str, Seeds, int]
#: The columns that are measured with a clock, and so differ between runs.
TIME_COLUMNS = ("time_first_us", "time_p50_us", "time_p99_us", "deadline_misses")
#: An arm is lost if its position error exceeds this, in [m], at any time, or its orientation error this, in [rad].
LOST_POSITION, LOST_ORIENTATION = 0.05, 0.3
#: A path was followed if the errors of all steps that count are at most so large, in [m] and [rad].
FOLLOWED_POSITION, FOLLOWED_ORIENTATION = 1e-3, 1e-3
#: What follows the name of a scenario whose plant is at its delay margin, and by how many times the largest error of a
#: policy that no longer follows its path grows there, at least, where it has too little of a margin.
AT_MARGIN, GROWTH = ", later", 3.0


@dataclasses.dataclass(frozen=True)
class Row:
    """The result of one episode.

    Where a scenario holds its nominal points for several steps, costs and errors are those of the steps that
    count, see :meth:`ikgym.Scenario.counted`; all else is over all steps.

    Args:
        scenario: Its name.
        policy: Its name.
        parameters: All parameters of the policy, except the seed of a reference.
        seed: The reset seed.
        steps: Steps of the episode.
        total_cost: Sum of −reward, added up step by step.
        tracking_cost: The part Φ^X.
        velocity_cost: The part Φ^U.
        cost_ratio: total_cost / best known cost, see :mod:`baselines.oracle.best_known`; None where there is none.
        position_error_max: Largest distance from the nominal position, in [m].
        position_error_rms: Its root mean square over the steps, in [m].
        orientation_error_max: Largest geodesic angle to the nominal orientation, in [rad]; None without one.
        orientation_error_rms: Its root mean square over the steps, in [rad]; None without an orientation.
        qdot_peak: Largest absolute joint velocity, in [rad/s] or [m/s].
        qdot_rms: Root mean square over steps and joints, in [rad/s] or [m/s].
        qdot_total_variation: Σ_k Σ_j |q̇_j(k+1) − q̇_j(k)|, in [rad/s] or [m/s].
        qddot_peak: Largest |q̇_j(k+1) − q̇_j(k)| / Δt, from rest at the start, in [rad/s²] or [m/s²].
        steps_at_joint_limit: Steps with a joint at a limit of its coordinate, see :func:`ikgym.arms.limits.at_limits`.
        steps_at_velocity_limit: Steps with a joint at its velocity limit.
        steps_at_acceleration_limit: Steps with a joint at its acceleration limit.
        joint_limit_margin_min: Smallest distance of a joint from a limit of its coordinate, in [rad] or [m]; None where
            the arm has no such limit.
        followed: Whether the path was followed, see :func:`is_followed`.
        solver_status: The worst status that the solver reported; unknown for policies that report none. It does not
            say whether the path was followed.
        time_p50_us: Median wall time of a call of the policy, in [µs], over all but the first, if there is another one.
            None, like all times, where the episode was played together with others.
        time_p99_us: Its 99th percentile, in [µs].
        deadline_misses: Calls after the first that took longer than the scenario's Δt.
        machine: Processor and versions, see :func:`describe`.
        iterations: Mean iterations of the policy in one step; None where they are not known.
        status_counts: Number of steps that ended with each status.
        preview: Furthest step ahead that the policy was shown.
        fingerprint: Digest of the scenario, see :func:`baselines.fingerprints.fingerprint`.
        time_first_us: Wall time of the first call of the policy, in [µs].
        test_set: Digest of the test set of the episode, see :mod:`baselines.evaluation.test_sets`; None without one.
        arm_seed: Seed of the arm; None if the reset seed sets it.
        noise_seed: Seed of the noise in sensors and drives; 0 is the noise of the reset seed.
        ideal: Fingerprint of the scenario with an ideal plant; that of the scenario if the plant is ideal.
        acceleration_stated: Whether each joint has an acceleration limit, or the arm has no limits at all.
        path_time: With free timing, the time in [s] in which the end of the path was reached; None if it was not.
        path_position_error: With free timing, the largest distance from the reference at the progress of the policy, in
            [m], to the end of the path; None without.
        path_orientation_error: Likewise, in [rad].
        clearance_min: Smallest distance between bodies until a stop, in [m]; None, like the rest, without collisions.
        closest_pair: The names of the two bodies that were closest, or that stopped the arm.
        closest_step: The step in which they were, from 1.
        stopped: The step of the stop, from 1; None also if the arm was not stopped.
        proximity_cost: The part Φ^C; None where the scenario has no such cost.
    """

    scenario: str
    policy: str
    parameters: dict[str, Any]
    seed: int
    steps: int
    total_cost: float
    tracking_cost: float
    velocity_cost: float
    cost_ratio: float | None
    position_error_max: float
    position_error_rms: float
    orientation_error_max: float | None
    orientation_error_rms: float | None
    qdot_peak: float
    qdot_rms: float
    qdot_total_variation: float
    qddot_peak: float
    steps_at_joint_limit: int
    steps_at_velocity_limit: int
    steps_at_acceleration_limit: int
    joint_limit_margin_min: float | None
    followed: bool
    solver_status: str
    time_p50_us: float | None
    time_p99_us: float | None
    deadline_misses: int | None
    machine: dict[str, Any]
    iterations: float | None
    status_counts: dict[str, int]
    preview: int
    fingerprint: str
    time_first_us: float | None
    test_set: str | None
    arm_seed: int | None = None
    noise_seed: int = 0
    ideal: str | None = None
    acceleration_stated: bool = True
    path_time: float | None = None
    path_position_error: float | None = None
    path_orientation_error: float | None = None
    clearance_min: float | None = None
    closest_pair: list[str] | None = None
    closest_step: int | None = None
    stopped: int | None = None
    proximity_cost: float | None = None

    @property
    def lost(self) -> bool:
        """Whether the arm was lost, see :func:`lost`."""
        return lost(self.position_error_max, self.orientation_error_max)

    @property
    def key(self) -> Key:
        """Identifies the episode within an evaluation."""
        seeds = Seeds(self.seed, self.arm_seed, self.noise_seed)
        return self.scenario, self.policy, canonical(self.parameters), seeds, self.steps

    def to_json(self) -> dict[str, Any]:
        """The row as JSON has it: numbers that are not finite are null."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {name: None if isinstance(v, float) and not math.isfinite(v) else v for name, v in values.items()}

    @classmethod
    def nan_restored(cls, values: Any) -> Any:
        """The values of :meth:`to_json` with NaN where a number was not finite; anything but an object as it is."""
        if not isinstance(values, Mapping):
            return values
        numbers = {field.name for field in dataclasses.fields(cls) if field.type == "float"}
        return {name: math.nan if value is None and name in numbers else value for name, value in values.items()}


class Skipped(NamedTuple):
    """A policy that does not suit a scenario, or a motion that no controller would accept."""

    scenario: str
    policy: str
    reason: str


class Rows(list[Row]):
    """The rows of an evaluation.

    Attributes:
        skipped: Policies that do not suit a scenario and motions that no controller would accept, with the reasons.
    """

    def __init__(self, rows: Iterable[Row] = (), skipped: Sequence[Skipped] = ()) -> None:
        super().__init__(rows)
        self.skipped = tuple(skipped)

    def frame(self) -> pd.DataFrame:
        """The rows as a data frame of pandas: one line an episode with the fields of a row and `lost`; NaN for None."""
        import pandas as pd  # slow to import

        fields = dataclasses.fields(Row)
        numbers = [field.name for field in fields if str(field.type).startswith(("float", "int | None"))]
        out = pd.DataFrame([vars(row) for row in self], columns=[field.name for field in fields])
        return out.astype(dict.fromkeys(numbers, float)).assign(lost=[row.lost for row in self])


def lost(position_error: float, orientation_error: float | None) -> bool:
    """Whether an arm was lost, by its largest errors in [m] and [rad] (None without one); NaN counts as lost."""
    return not _within(LOST_POSITION, LOST_ORIENTATION, position_error, orientation_error)


def is_followed(position_error: float, orientation_error: float | None) -> bool:
    """Whether a path was followed, within 1 mm and 1 mrad; the arguments are those of :func:`lost`."""
    return _within(FOLLOWED_POSITION, FOLLOWED_ORIENTATION, position_error, orientation_error)


def lacks_margin(error: float, later: float) -> bool:
    """Whether a policy loses its path at a delay margin, by its largest position errors without and at it, in [m]."""
    return not (later <= FOLLOWED_POSITION or later <= GROWTH * error)


def _within(distance: float, angle: float, position_error: float, orientation_error: float | None) -> bool:
    """Whether errors are at most so large; NaN is not."""
    return position_error <= distance and (orientation_error is None or orientation_error <= angle)


def measure(
    scenario: Scenario,
    policy: str,
    parameters: Mapping[str, Any],
    episode: Episode,
    *,
    machine: Mapping[str, Any],
    preview: int,
    fingerprint: str,
    test_set: str | None = None,
    best_known: float | None = None,
    ideal: str | None = None,
) -> Row:
    """The row of a recorded episode; see :class:`Row`; the cost ratio is stated against `best_known`."""
    seeds, along_path = episode.seeds, dict[str, Any]()
    if "progress" in episode.diagnostics:
        from baselines.evaluation.motion.free_timing import first_steps, path_scores

        along_path, episode = path_scores(scenario, episode), first_steps(episode, scenario.steps)
    total = float(add_up(episode.cost))
    timed, later = len(episode.time_ns) > 0, episode.time_ns[1:] if len(episode.time_ns) > 1 else episode.time_ns
    counted = scenario.counted()[1:]
    angles = episode.orientation_error[counted] if scenario.task.has_orientation else None
    position_error = float(episode.position_error[counted].max())
    orientation_error = None if angles is None else float(angles.max())
    qddot = np.diff(episode.qdot, axis=0, prepend=0.0) / scenario.dt
    limits = {name: getattr(scenario.arm, name) for name in BOUNDS}
    at = at_limits({"q": episode.q, "qdot": episode.qdot, "qddot": qddot, **limits})
    statuses = collections.Counter(episode.status.tolist())
    worst = Status(max(statuses))
    return Row(
        scenario=scenario.name,
        policy=policy,
        parameters=dict(parameters),
        seed=seeds.seed,
        steps=scenario.steps,
        total_cost=total,
        tracking_cost=float(add_up(episode.tracking_cost)),
        velocity_cost=float(add_up(episode.velocity_cost)),
        cost_ratio=None if best_known is None else total / best_known,
        position_error_max=position_error,
        position_error_rms=_rms(episode.position_error[counted]),
        orientation_error_max=orientation_error,
        orientation_error_rms=None if angles is None else _rms(angles),
        qdot_peak=float(np.abs(episode.qdot).max()),
        qdot_rms=_rms(episode.qdot),
        qdot_total_variation=float(np.abs(np.diff(episode.qdot, axis=0)).sum()),
        qddot_peak=float(np.abs(qddot).max()),
        steps_at_joint_limit=int(at.stop.any(axis=1).sum()),
        steps_at_velocity_limit=int(at.velocity.any(axis=1).sum()),
        steps_at_acceleration_limit=int(at.acceleration.any(axis=1).sum()),
        joint_limit_margin_min=_margin(scenario.arm, episode.q),
        followed=is_followed(position_error, orientation_error),
        solver_status=worst.label,
        time_p50_us=float(np.percentile(later, 50)) / 1e3 if timed else None,
        time_p99_us=float(np.percentile(later, 99)) / 1e3 if timed else None,
        deadline_misses=int((later > 1e9 * scenario.dt).sum()) if timed else None,
        machine=dict(machine),
        iterations=None if worst is Status.UNKNOWN else float(episode.iterations.mean()),
        status_counts={Status(status).label: count for status, count in sorted(statuses.items())},
        preview=preview,
        fingerprint=fingerprint,
        time_first_us=float(episode.time_ns[0]) / 1e3 if timed else None,
        test_set=test_set,
        arm_seed=seeds.arm_seed,
        noise_seed=seeds.noise_seed,
        ideal=ideal,
        acceleration_stated=bool(np.isfinite(scenario.arm.acceleration_limit).all()) or not scenario.arm.limited,
        **along_path,
        **_contacts(scenario, episode),
    )


def _contacts(scenario: Scenario, episode: Episode) -> dict[str, Any]:
    """Clearance, closest pair, stop and Φ^C; empty where nothing can meet."""
    if episode.clearance is None or episode.pair is None or episode.stopped is None or episode.pair[0, 0] < 0:
        return {}
    stops = np.flatnonzero(episode.stopped)
    until = episode.clearance[: stops[0] + 1] if len(stops) else episode.clearance
    step = int(stops[0] if len(stops) else until.argmin())
    return {
        "clearance_min": float(until.min()),
        "closest_pair": list(scenario.pair_names(episode.pair[step].astype(np.int64).tolist())),
        "closest_step": step + 1,
        "stopped": step + 1 if len(stops) else None,
        "proximity_cost": None if episode.proximity_cost is None else float(add_up(episode.proximity_cost)),
    }


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _margin(arm: Arm, q: FloatArray) -> float | None:
    """The smallest distance from a limit of the joint coordinates, None where there is none."""
    if not np.isfinite([arm.lower, arm.upper]).any():
        return None
    return float(min((q - arm.lower).min(), (arm.upper - q).min()))


@functools.cache
def _cpu() -> str:
    try:
        for line in pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass  # no Linux
    return platform.processor() or platform.machine() or "unknown"


def describe() -> dict[str, Any]:
    """CPU, the cores that this process may use, and the versions that matter to a number."""
    return {
        "cpu": _cpu(),
        "cores": count_cores(),
        "system": platform.system(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "ikgym": ikgym.__version__,
    }
