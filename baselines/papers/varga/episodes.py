"""Varga 2021: the runs that figures and claims share, their readings, and how much their velocities fluctuate."""

from __future__ import annotations

import itertools

import numpy as np

from baselines.episodes import Episode
from baselines.papers.paper import roughness
from baselines.papers.runs import Runs
from baselines.status import Status
from ikgym.validation import FloatArray

FAST, SLOW, LITERAL = "varga7-fast", "varga7-slow", "varga7-literal-fast"
METHOD = "rhc_gradient"

#: What the text leaves open: where α starts, and whether the warm start is shifted. The first is what figures show.
READINGS = tuple(
    {"alpha_start": alpha_start, "warm_start": warm_start}
    for alpha_start, warm_start in itertools.product(("restart", "kept"), ("unshifted", "shifted"))
)

#: α kept from period to period, with a bound below the printed one under which nothing diverges.
KEPT = {"alpha_start": "kept", "alpha_max": 1e-4}

#: "significantly", "considerably": one and a half times; "more", "better": a tenth. The same for all claims.
CONSIDERABLE, MORE = 1.5, 1.1


def fast(runs: Runs) -> Episode:
    """The paper's method on the fast trajectory."""
    return runs.play(FAST, METHOD)


def slow(runs: Runs) -> Episode:
    """The paper's method on the slow trajectory."""
    return runs.play(SLOW, METHOD)


def smooth(runs: Runs) -> Episode:
    """The fast trajectory with second-order smoothing behind the method."""
    return runs.play(FAST, "smoothed", policy=METHOD)


def nominal_path(runs: Runs, name: str) -> FloatArray:
    """Eq. 11 or 12: the nominal joint coordinates, in [rad] or [m]. Shape (steps + 1, 7)."""
    return np.asarray(runs.scenario(name).nominal_joint_path(), dtype=np.float64)


def diverged(episode: Episode) -> float:
    """The share of steps that blew up."""
    return float((episode.status == Status.DIVERGED).mean())


def at_limit(episode: Episode) -> float:
    """The share of steps with all 450 steps of the descent."""
    return float((episode.iterations == 450).mean())


def without_start(qdot: FloatArray) -> FloatArray:
    """Joint velocities without the start, whose jump from rest would outweigh all else."""
    return qdot[len(qdot) // 20 :]


def fluctuation(qdot: FloatArray) -> float:
    """Root mean square of the second differences of the joint velocities, without the start, in [rad/s] or [m/s]."""
    return roughness(without_start(qdot))


def largest_jump(qdot: FloatArray) -> float:
    """The largest change of a joint velocity from one step to the next, without the start, over the peak."""
    return float(np.abs(np.diff(without_start(qdot), axis=0)).max() / np.abs(qdot).max())


def variation(qdot: FloatArray) -> float:
    """Total variation of the joint velocities: the sum of all changes over steps and joints, in [rad/s] and [m/s]."""
    return float(np.abs(np.diff(qdot, axis=0)).sum())
