"""Varga 2021: episodes that figures and claims share, and measures of their fluctuation."""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np

from baselines.episodes import Episode
from baselines.papers.comparisons import roughness
from baselines.papers.runs import Runs
from baselines.registry import make
from baselines.status import Status
from ikgym import RedundantIKEnv
from ikgym.validation import FloatArray

FAST, SLOW, LITERAL = "varga7-fast", "varga7-slow", "varga7-literal-fast"
METHOD = "rhc_gradient"

#: The text leaves open where α starts and whether the warm start is shifted. Figures show the first reading.
READINGS = tuple(
    {"alpha_start": alpha_start, "warm_start": warm_start}
    for alpha_start, warm_start in itertools.product(("restart", "kept"), ("unshifted", "shifted"))
)

#: α kept from period to period, with a bound below the printed one under which nothing diverges.
KEPT: dict[str, Any] = {"alpha_start": "kept", "alpha_max": 1e-4}

#: Both readings of α with which nothing diverges.
ALPHAS: dict[str, dict[str, Any]] = {"restarted": {}, "kept": KEPT}


def fast(runs: Runs) -> Episode:
    """The paper's method on the fast trajectory."""
    return runs.play(FAST, METHOD)


def time_of_step(runs: Runs, **parameters: Any) -> float:
    """The median processor time of a step of the method, over the first 100 of the fast trajectory, in [s].

    Steps of some milliseconds are interrupted by other programs, whose time is not counted.
    """
    scenario = runs.scenario(FAST)
    policy, times, state = make(METHOD, scenario, **parameters), [], None
    env = RedundantIKEnv(scenario, preview=policy.preview)
    observation, _ = env.reset(seed=0)
    for _ in range(min(100, scenario.steps)):
        begin = time.thread_time()
        action, state = policy.predict(observation, state)
        times.append(time.thread_time() - begin)
        observation, *_ = env.step(action)
    return float(np.median(times))


def slow(runs: Runs) -> Episode:
    """The paper's method on the slow trajectory."""
    return runs.play(SLOW, METHOD)


def smooth(runs: Runs) -> Episode:
    """The fast trajectory with second-order smoothing after the method."""
    return runs.play(FAST, "smoothed", policy=METHOD)


def share_diverged(episode: Episode) -> float:
    """The share of control steps that diverged."""
    return float((episode.status == Status.DIVERGED).mean())


def at_limit(episode: Episode) -> float:
    """The share of control steps with 450 iterations of the descent."""
    return float((episode.iterations == 450).mean())


def without_start(qdot: FloatArray) -> FloatArray:
    """Joint velocities without the first twentieth, whose jump from rest would dominate."""
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


def nominal_angles(runs: Runs, name: str) -> FloatArray:
    """Angles of rotation from the home orientation along the nominal path, in [rad]. Shape (k,)."""
    rotations, _ = runs.scenario(name).arm.forward(np.asarray(runs.scenario(name).nominal_joint_path()))
    skew = 0.5 * (rotations - np.swapaxes(rotations, 1, 2))[:, (0, 0, 1), (1, 2, 2)]
    sine, cosine = np.linalg.norm(skew, axis=1), 0.5 * (np.trace(rotations, axis1=1, axis2=2) - 1.0)
    return np.asarray(np.arctan2(sine, cosine))
