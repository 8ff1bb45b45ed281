"""Zhang 2020: episodes that figures and claims share, their inputs, outputs, Jacobians and λ."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.papers.runs import Runs
from baselines.policy import Batch
from baselines.recording import Episode
from baselines.registry import make
from baselines.solvers.levenberg_marquardt.damping import typical_link
from baselines.solvers.levenberg_marquardt.iteration import DampingMemory
from baselines.status import Status
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

    The policy sees so many steps ahead; with ``hold`` the first point is repeated.
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
