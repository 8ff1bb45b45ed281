"""Zhang 2020: episodes that figures and claims share, and targets of the inverse kinematics with their iterates."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.episodes import Episode
from baselines.papers.runs import Runs
from baselines.policy import Batch, SolverPolicy
from baselines.registry import make
from baselines.solvers.levenberg_marquardt.damping import typical_link
from baselines.solvers.levenberg_marquardt.iteration import DampingMemory
from baselines.status import Status
from ikgym.arms import Arm
from ikgym.scenarios import Scenario
from ikgym.trajectories import StraightLine
from ikgym.validation import FloatArray

HELIX, LINE = "zhang3-helix", "zhang6-lspb"
#: The controllers of example 1, (5) and (27), (28) under (44), with λ in [m²] and the threshold in [m], and the
#: iteration (55)-(59) of example 2, with the printed numbers.
ADAPTIVE: dict[str, Any] = {"rule": "threshold", "damping": 2.0, "growth": 1.1, "decay": 1.02, "threshold": 10.0}
ADAPTIVE |= {"carry": True, "one_step": True}
PREDICTIVE = ADAPTIVE | {"horizon": 5, "jacobians": "constant"}
ITERATIVE: dict[str, Any] = {"rule": "constant", "damping": 0.0, "horizon": 2, "iterations": 10}
#: Paths past singular points.
SINGULAR = ("faitli3-stretched", "faitli3-shoulder")
SETTLED = 60  # samples after which the transient of example 1 has died away


def predictive(runs: Runs) -> Episode:
    """Example 1: the controller (27), (28), (44) on the helix."""
    return runs.play(HELIX, "mfapc", **PREDICTIVE)


def adaptive(runs: Runs) -> Episode:
    """The same without prediction."""
    return runs.play(HELIX, "mfac", **ADAPTIVE)


def constant(runs: Runs, scenario: str, damping: float, horizon: int = 1) -> Episode:
    """The controllers (5) and (27) with a constant λ."""
    if horizon == 1:
        return runs.play(scenario, "mfac", one_step=True, rule="constant", damping=damping)
    numbers = {"horizon": horizon, "jacobians": "constant", "one_step": True, "rule": "constant"}
    return runs.play(scenario, "mfapc", damping=damping, **numbers)


def iterative(runs: Runs, **numbers: Any) -> Episode:
    """Example 2: the iteration (55)-(59) on the line."""
    return runs.play(LINE, "mfapc", **ITERATIVE | numbers)


def settled_from(episode: Episode) -> int:
    """The first sample after the transient; in a short trial the middle one."""
    return min(SETTLED, len(episode.q) // 2)


def settled_error(episode: Episode) -> float:
    """The largest position error after the transient, in [m]."""
    return float(episode.position_error[settled_from(episode) :].max())


def _joints(scenario: Scenario, episode: Episode) -> FloatArray:
    """q(0), q(1), …: the joint coordinates before each input, and at the end. Shape (steps + 1, n)."""
    start = np.zeros(scenario.joints) if scenario.start is None else scenario.start
    return np.vstack([start, episode.q])


def outputs(scenario: Scenario, episode: Episode) -> FloatArray:
    """y(1), y(2), …: the measured outputs. Shape (steps + 1, m)."""
    first = scenario.initial_pose
    if first is None:
        first = scenario.task.coordinates(*scenario.arm.forward(_joints(scenario, episode)[0]))
    return np.vstack([first, episode.pose])


def jacobians_used(scenario: Scenario, episode: Episode) -> FloatArray:
    """J(1), J(2), …: the Jacobians that the controller used. Shape (steps, 3, n)."""
    return np.asarray(scenario.model.jacobian(_joints(scenario, episode)[:-1])[:, :3])


def lambdas_used(episode: Episode) -> FloatArray:
    """λ(1), λ(2), … of example 1, as the controller used them; its memory holds the next one. Shape (steps,)."""
    return np.concatenate([[PREDICTIVE["damping"]], episode.diagnostics["lambda"][:-1]])


def of_link(runs: Runs, scenario: str, share: float) -> float:
    """λ in [m²], given as a share of the square of the mean link l."""
    return share * float(typical_link(runs.scenario(scenario).arm)) ** 2


def ramp_errors(runs: Runs, velocity: float, damping: float, horizon: int = 1) -> tuple[FloatArray, FloatArray]:
    """The static error on a straight ramp of example 1's arm, measured and by eq. 10, in [m].

    The velocity is the way of one period in [m], the damping λ in [m²], and the horizon n.
    """
    scenario, q = runs.scenario(HELIX), np.array([0.3, 0.6, 1.0])
    steps = min(scenario.steps, 400)
    direction = np.array([1.0, 2.0, -2.0]) / 3.0
    start = np.concatenate([np.eye(3).ravel(), scenario.arm.forward(q)[1]])
    # The blends last 20 periods; the ramp ends after the episode.
    end = start + np.concatenate([np.zeros(9), (steps + 30) * velocity * direction])
    line = StraightLine(start, end, duration=float(steps + 50), blend=20.0)
    ramp = scenario.replace(trajectory=line, start=q, initial_pose=None, steps=steps)
    options: dict[str, Any] = {"one_step": True, "rule": "constant", "damping": damping}
    if horizon > 1:
        options["horizon"] = horizon
    episode = runs.play(ramp, "mfac" if horizon == 1 else "mfapc", **options)
    u, sigma, _ = np.linalg.svd(jacobians_used(ramp, episode)[-1])
    formula = u @ np.diag(damping / sigma**2) @ u.T @ (velocity * direction)
    return ramp.nominal()[-1] - episode.pose[-1], formula


def along_the_helix(runs: Runs, policy: str, ahead: int, *, hold: bool = False, **parameters: Any) -> FloatArray:
    """Inputs of single steps from all states of example 1, the first, singular one left out. Shape (steps - 1, 3).

    The policy sees ``ahead`` steps; with ``hold`` the first point is repeated.
    """
    scenario, episode = runs.scenario(HELIX), predictive(runs)
    nominal, steps = scenario.nominal(preview=ahead), len(episode.q)
    points = [np.arange(1, steps) + (1 if hold else 1 + j) for j in range(ahead)]
    q = episode.q[:-1]
    batch = Batch(
        q, np.zeros_like(q), episode.pose[:-1], np.stack([nominal[p] for p in points], 1), np.ones((len(q), 1))
    )
    solver = make(policy, scenario, one_step=True, rule="constant", **parameters)
    return solver.solve(batch, solver.memory(len(q))).qdot


def unmet_of_the_way(runs: Runs) -> float:
    """The largest error of example 2's horizon that (40) leaves unmet, as a share of the next distance."""
    scenario, episode = runs.scenario(LINE), iterative(runs)
    policy = make("mfapc", scenario, **ITERATIVE)
    nominal, later = scenario.nominal(preview=policy.preview), np.arange(2, len(episode.q) + 1)
    q, ahead = episode.q[:-1], np.stack([nominal[later], nominal[later + 1]], axis=1)
    batch = Batch(q, np.zeros_like(q), episode.pose[:-1], ahead, np.ones((len(q), 1)))
    solution = policy.solve(batch, policy.memory(len(q)))
    unmet = solution.status == Status.ITERATION_LIMIT
    way = np.linalg.norm(scenario.task.error(ahead[unmet, 1], ahead[unmet, 0]), axis=1)
    return float((DampingMemory(*solution.memory).error[unmet] / way).max())


ITERATIONS, PERIODS = 10, 200
#: λ in l²: 0, and the range of remark 2.
SHARES = (0.0, 1e-3, 1e-1)

#: Sets of targets: the scenario of the arm, the distance of a target in [rad], and the joint that is straight there.
TARGETS: dict[str, tuple[str, float, int | None]] = {
    "3 joints": (HELIX, np.pi, None),
    "6 joints": (LINE, np.pi, None),
    "stretched": (HELIX, 0.5, 2),
    "wrist straight": (LINE, 0.5, 4),
}


@dataclasses.dataclass(frozen=True, eq=False)
class Targets:
    """Targets of the inverse kinematics, task coordinates (rows, m), and initial guesses (rows, n) in [rad]."""

    scenario: Scenario
    q: FloatArray
    coordinates: FloatArray

    def error(self, q: FloatArray) -> FloatArray:
        """Task error at joint coordinates of shape (rows, n). Shape (rows, e)."""
        return np.asarray(self.scenario.task.error(self.coordinates, self._coordinates_at(q)))

    def solve(self, policy: SolverPolicy) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """Joint coordinates after one period of a policy, in [rad], and its statuses. Shapes (rows, n) and (rows,)."""
        rows = len(self.q)
        nominal = self.coordinates[:, None]
        batch = Batch(self.q, np.zeros_like(self.q), self._coordinates_at(self.q), nominal, np.ones((rows, 1)))
        solution = policy.solve(batch, policy.memory(rows))
        return self.q + solution.qdot * self.scenario.dt, solution.status

    def jacobian(self, q: FloatArray) -> FloatArray:
        """Jacobian of the task. Shape (rows, e, n)."""
        return np.asarray(self.scenario.model.jacobian(q)[:, : self.scenario.task.error_size])

    def _coordinates_at(self, q: FloatArray) -> FloatArray:
        return np.asarray(self.scenario.task.coordinates(*self.scenario.model.forward(q)))


def draw_targets(runs: Runs, name: str) -> Targets:
    """1000 targets of a set of :data:`TARGETS`; fewer in a trial."""
    of, far, straight = TARGETS[name]
    scenario, rng = runs.scenario(of), np.random.default_rng(0)
    shape = min(1000, runs.steps or 1000), scenario.joints
    q = rng.uniform(-np.pi, np.pi, shape)
    goal = rng.uniform(-np.pi, np.pi, shape) if straight is None else q + rng.uniform(-far, far, shape)
    if straight is not None:
        goal[:, straight] = 0.0
    return Targets(scenario, q, np.asarray(scenario.task.coordinates(*scenario.model.forward(goal))))


def share_met(runs: Runs, name: str, rule: Mapping[str, Any]) -> tuple[float, float]:
    """The share of a set of targets that `mfac` meets to δ = 1e-10 in 500 iterations, and the median error left.

    The dampings of the rule for λ are in l².
    """
    targets, square = draw_targets(runs, name), of_link(runs, TARGETS[name][0], 1.0)
    in_metres = {key: (square * np.array(rule[key])).tolist() for key in ("damping", "dampings") if key in rule}
    q, status = targets.solve(make("mfac", targets.scenario, **{**rule, **in_metres}))
    left = np.linalg.norm(targets.error(q), axis=1)
    return float((status == Status.CONVERGED).mean()), float(np.median(left))


class Iterate(NamedTuple):
    """The states of all targets' solutions at one iteration in [rad], with norm and Jacobian of the task error."""

    q: FloatArray
    error: FloatArray
    jacobian: FloatArray


def iterates(targets: Targets, **parameters: object) -> list[Iterate]:
    """The states after 0, 1, … 10 iterations of `mfac`."""
    path = [targets.q]
    for i in range(1, ITERATIONS + 1):
        policy = make("mfac", targets.scenario, iterations=i, tolerance=0.0, **parameters)
        path.append(targets.solve(policy)[0])
    return [Iterate(q, np.linalg.norm(targets.error(q), axis=1), targets.jacobian(q)) for q in path]


def sugihara(targets: Targets, damping: float) -> list[FloatArray]:
    """Levenberg–Marquardt iteration of [1], in joint space: (Jᵀ J + λ I) Δq = Jᵀ e with λ = ½ ‖e‖² + a constant."""
    path, eye = [targets.q], np.eye(targets.q.shape[1])
    for _ in range(ITERATIONS):
        q, error = path[-1], targets.error(path[-1])
        jacobian = targets.jacobian(q)
        back = jacobian.transpose(0, 2, 1)
        lambdas = 0.5 * (error**2).sum(axis=1) + damping
        whole = back @ jacobian + lambdas[:, None, None] * eye
        path.append(q + np.linalg.solve(whole, back @ error[:, :, None])[:, :, 0])
    return path


def rank_correlation(a: FloatArray, b: FloatArray) -> float:
    """Spearman's ρ of two arrays of shape (k,)."""
    first, second = (values.argsort(kind="stable").argsort(kind="stable") for values in (a, b))
    return float(np.corrcoef(first, second)[0, 1])


def _regular(arm: Arm, rows: int, shift: float) -> tuple[FloatArray, FloatArray]:
    """Starts and, a shift in [rad] from each, joint coordinates of targets, both with cond(J) < 10."""
    rng = np.random.default_rng(0)
    goal, way = rng.uniform(-np.pi, np.pi, (20 * rows, 3)), rng.normal(size=(20 * rows, 3))
    q = goal + shift * way / np.linalg.norm(way, axis=1, keepdims=True)
    kept = np.all([np.linalg.cond(arm.jacobian(ends)[:, :3]) < 10.0 for ends in (q, goal)], axis=0)
    return q[kept][:rows], goal[kept][:rows]


def at_rest(runs: Runs, share: float, shift: float, *, links: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """The response of `mfac` with `one_step` to 200 targets at rest at a distance in [rad], with example 1's arm.

    λ is a share of l², the length of the model's links one of the true ones. Gives the error, and the way beyond the
    target, as shares of the distance at the start: shapes (periods, rows).
    """
    scenario = runs.scenario(HELIX)
    arm = scenario.arm
    changed = scenario.replace(model=dataclasses.replace(arm, offsets=links * arm.offsets, tool=links * arm.tool))
    policy = make("mfac", changed, one_step=True, rule="constant", damping=of_link(runs, HELIX, share))
    q, goal = _regular(arm, min(200, runs.steps or 200), shift)
    target = arm.forward(goal)[1]
    way = target - arm.forward(q)[1]
    distance = np.linalg.norm(way, axis=1)
    errors, beyond = [], []
    for _ in range(PERIODS):
        pose = arm.forward(q)[1]
        errors.append(np.linalg.norm(target - pose, axis=1) / distance)
        beyond.append(((pose - target) * way).sum(axis=1) / distance**2)
        batch = Batch(q, np.zeros_like(q), pose, target[:, None], np.ones((len(q), 1)))
        q = q + policy.solve(batch, policy.memory(len(q))).qdot * scenario.dt
    return np.array(errors), np.array(beyond)
