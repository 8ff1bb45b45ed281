"""Varga 2021: the runs that figures and claims share, and how much their velocities fluctuate."""

from __future__ import annotations

from baselines.evaluation.rollout import Episode
from baselines.papers.paper import roughness
from baselines.papers.runs import Runs
from ikgym.validation import FloatArray

FAST, SLOW = "varga7-fast", "varga7-slow"
METHOD, PRINTED = "rhc_gradient", {"alpha_max": 5e-4}


def fast(runs: Runs) -> Episode:
    """The paper's method on the fast trajectory."""
    return runs.play(FAST, METHOD)


def slow(runs: Runs) -> Episode:
    """The paper's method on the slow trajectory."""
    return runs.play(SLOW, METHOD)


def smooth(runs: Runs) -> Episode:
    """The fast trajectory with second-order smoothing behind the method."""
    return runs.play(FAST, "smoothed", policy=METHOD)


def fluctuation(qdot: FloatArray) -> float:
    """Root mean square of the second differences of the joint velocities, in [rad/s] or [m/s].

    Without the start, whose jump from rest would outweigh all else.
    """
    return roughness(qdot[len(qdot) // 20 :])
