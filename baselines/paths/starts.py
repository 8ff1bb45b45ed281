"""Start branches: the postures in which an arm can begin a path."""

from __future__ import annotations

import numpy as np

from baselines.paths.motion import ideal, in_time, play_from
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.obstacles.solids import closest
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
    """Joint coordinates at the first pose of a path, one a branch, that of the scenario first; shape (N, n).

    Most of them are where `qp` leads redundant joints while the pose is held, so that they are at rest when the path
    begins; few others are not. Where the scenario has collisions, all of them are clear.

    Args:
        scenario: A result of :func:`baselines.paths.motion.ideal`.

    Raises:
        InvalidInputError: No posture at the first pose is clear.
    """
    usual, found = scenario.first_q(scenario.trajectory)[None], solutions(scenario)
    if scenario.collides:
        usual, found = _clear(scenario, usual, found)
    if not len(found):
        return usual
    settled = play_from(_hold_first_pose(scenario), _middlemost(scenario.arm, found))
    still = settled.q[-1][settled.position_error[-1] < 1e-6]
    return _distinct(scenario.arm, _distinct(scenario.arm, usual, still, BRANCHES), found, BRANCHES)


def _clear(scenario: Scenario, usual: FloatArray, found: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Those that touch nothing: the scenario's start, of shape (1, n), and of others, of shape (k, n)."""
    every = np.vstack([usual, found])
    pairs = closest(scenario.arm, every, scenario.obstacle_rows(1), scenario.surroundings.checked)
    clear = pairs.distances > 0.0
    if not clear.any():
        best = int(np.argmax(pairs.distances))
        first, second = scenario.pair_names(pairs.pairs[best].tolist())
        raise InvalidInputError(
            f"Scenario {scenario.name!r}: expected a posture at the first pose that touches nothing, got none among "
            f"{len(every)}; in the best of them {first!r} and {second!r} overlap by {-1e3 * pairs.distances[best]:.3g} "
            "mm. A pair that may touch is named by `ignored` of the bodies or of the obstacle."
        )
    return usual[clear[:1]], found[clear[1:]]


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


def _hold_first_pose(scenario: Scenario) -> Scenario:
    """The first pose, held."""
    ends = np.array([0.0, SETTLING])
    held = in_time(scenario, lambda one: RetimedTrajectory(one, ends, np.zeros(2), np.zeros(2)))
    return ideal(scenario, **held, dt=PERIOD)


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
    """Known postures, or the first, and others that differ from them, each the farthest from those before. (N, n)."""
    size = np.where(arm.prismatic, arm.reach(np.zeros(arm.joints)) or 1.0, 1.0)
    chosen = list(known) or list(q[:1])
    while len(chosen) < most and len(q):
        distance = np.min([np.abs((q - one) / size).max(axis=1) for one in chosen], axis=0)
        if distance.max() < APART:
            break
        chosen.append(q[np.argmax(distance)])
    return np.array(chosen).reshape(-1, arm.joints)
