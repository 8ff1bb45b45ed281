"""Zhang 2020: the runs that figures and claims share, and what is read from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from baselines.episodes import Episode
from baselines.papers.runs import Runs
from baselines.solvers.levenberg_marquardt.presets import HelixPredictiveControl
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

HELIX, LINE = "zhang3-helix", "zhang6-lspb"
SETTLED = 60  # samples after which the transient of example 1 has died away


def predictive(runs: Runs) -> Episode:
    """Example 1: the controller (27), (28), (44) on the helix."""
    return runs.play(HELIX, "mfapc_helix")


def adaptive(runs: Runs) -> Episode:
    """The same without prediction."""
    return runs.play(HELIX, "mfac_helix")


def constant(runs: Runs, scenario: str, damping: float, horizon: int = 1) -> Episode:
    """The controllers (5) and (27) with a constant λ."""
    if horizon == 1:
        return runs.play(scenario, "mfac", one_step=True, rule="constant", damping=damping)
    numbers = {"horizon": horizon, "jacobians": "constant", "one_step": True, "rule": "constant"}
    return runs.play(scenario, "mfapc", damping=damping, **numbers)


def iterative(runs: Runs, **numbers: Any) -> Episode:
    """Example 2: the iteration (55)-(59) on the line."""
    return runs.play(LINE, "mfapc_line", **numbers)


def settled_from(episode: Episode) -> int:
    """The sample from which the transient is over, in a short trial the middle."""
    return min(SETTLED, len(episode.q) // 2)


def _joints(scenario: Scenario, episode: Episode) -> FloatArray:
    """q(0), q(1), …: where the arm stood before each sample's input, then at the end. Shape (steps + 1, n)."""
    start = np.zeros(scenario.joints) if scenario.start is None else scenario.start
    return np.vstack([start, episode.q])


def outputs(scenario: Scenario, episode: Episode) -> FloatArray:
    """y(1), y(2), …: what was measured. Shape (steps + 1, m)."""
    first = scenario.initial_pose
    if first is None:
        first = scenario.task.coordinates(*scenario.arm.forward(_joints(scenario, episode)[0]))
    return np.vstack([first, episode.pose])


def jacobians_used(scenario: Scenario, episode: Episode) -> FloatArray:
    """J(1), J(2), …: what the controller used. Shape (steps, 3, n)."""
    return np.asarray(scenario.model.jacobian(_joints(scenario, episode)[:-1])[:, :3])


def lambdas_used(episode: Episode) -> FloatArray:
    """λ(1), λ(2), … of example 1, as the controller used them; what it kept is for the next sample. Shape (steps,)."""
    return np.concatenate([[HelixPredictiveControl.damping], episode.diagnostics["lambda"][:-1]])


def listed(values: Mapping[str, float], form: str = ".3g", unit: str = "") -> str:
    """Values by name, in words."""
    return "; ".join(f"{name}: {value:{form}}{unit}" for name, value in values.items())
