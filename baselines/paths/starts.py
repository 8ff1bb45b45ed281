"""Start branches: the postures in which an arm can begin a path."""

from __future__ import annotations

import numpy as np

from baselines.paths.motion import ideal, played
from ikgym.arms import Arm
from ikgym.scenarios import Scenario
from ikgym.trajectories import RetimedTrajectory
from ikgym.validation import FloatArray

#: Random postures from which the first pose is searched, and the most branches that are kept.
SEARCHES, BRANCHES = 256, 10
#: Branches differ by at least this angle in one joint in [rad], or this share of the arm's length.
APART = 0.2
#: Time and control period in [s] in which redundant joints come to rest at the first pose.
SETTLING, PERIOD = 12.0, 0.1


def starts(scenario: Scenario) -> FloatArray:
    """Joint coordinates at the first pose of a path, one a branch, the scenario's own first; shape (N, n).

    Most of them are where `qp` leads redundant joints while the pose is held, so that they are at rest when the path
    begins; few others are not.

    Args:
        scenario: A result of :func:`baselines.paths.motion.ideal`.
    """
    own = scenario.first_q(scenario.trajectory)[None]
    found = solutions(scenario)
    if not len(found):
        return own
    settled = played(_held(scenario), _middlemost(scenario.arm, found))
    still = settled.q[-1][settled.position_error[-1] < 1e-6]
    return _distinct(scenario.arm, _distinct(scenario.arm, own, still, BRANCHES), found, BRANCHES)


def solutions(scenario: Scenario) -> FloatArray:
    """Joint coordinates within the limits at the first pose, from random postures. Shape (k, n)."""
    arm, rng = scenario.arm, np.random.default_rng(0)
    frame = scenario.frames(scenario.trajectory, 1)[0]
    rotation = _rotations(frame, scenario.task.error_size, rng)
    random = rng.uniform(*_ranges(arm), (SEARCHES, arm.joints))
    q, converged = arm.inverse(rotation, frame[-3:], start=random, tolerance=1e-9, restarts=0)
    return q[converged]


def _rotations(frame: FloatArray, errors: int, rng: np.random.Generator) -> FloatArray | None:
    """Rotations of the tool that will do; None where all will, and random ones about its z axis where that is free."""
    if errors < 5:
        return None
    rotation = frame[:9].reshape(3, 3)
    if errors > 5:
        return rotation
    angle = rng.uniform(-np.pi, np.pi, SEARCHES)
    c, s, zero = np.cos(angle), np.sin(angle), np.zeros(SEARCHES)
    turns = np.array([[c, -s, zero], [s, c, zero], [zero, zero, zero + 1.0]]).transpose(2, 0, 1)
    turned: FloatArray = rotation @ turns
    return turned


def _held(scenario: Scenario) -> Scenario:
    """The first pose, held."""
    ends = np.array([0.0, SETTLING])
    held = RetimedTrajectory(scenario.trajectory, ends, np.zeros(2), np.zeros(2))
    return ideal(scenario, trajectory=held, dt=PERIOD)


def _ranges(arm: Arm) -> tuple[FloatArray, FloatArray]:
    """Ranges of random postures: the limits, or a turn about 0."""
    span = np.where(arm.prismatic, arm.reach(np.zeros(arm.joints)), np.pi)
    lower = np.where(np.isfinite(arm.lower), arm.lower, np.where(np.isfinite(arm.upper), arm.upper - 2 * span, -span))
    return lower, np.where(np.isfinite(arm.upper), arm.upper, lower + 2 * span)


def _middlemost(arm: Arm, q: FloatArray) -> FloatArray:
    """The same postures, joints turned by full turns as near to the middle of their limits as they can be."""
    lower, upper = _ranges(arm)
    turns = np.where(arm.prismatic, 0.0, np.round((q - 0.5 * (lower + upper)) / (2 * np.pi)))
    return q - 2 * np.pi * turns


def _distinct(arm: Arm, known: FloatArray, q: FloatArray, most: int) -> FloatArray:
    """Known postures and others that differ from them, each the farthest from those before. Shape (N, n)."""
    size = np.where(arm.prismatic, arm.reach(np.zeros(arm.joints)) or 1.0, 1.0)
    chosen = list(known)
    while len(chosen) < most and len(q):
        distance = np.min([np.abs((q - one) / size).max(axis=1) for one in chosen], axis=0)
        if distance.max() < APART:
            break
        chosen.append(q[np.argmax(distance)])
    return np.array(chosen)
