"""CppFlow's rule for a path-following problem: passed or failed at its waypoints."""

from __future__ import annotations

import dataclasses

import numpy as np

from ikgym import problems
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.rotations import geodesic_angle
from ikgym.scenarios import Scenario
from ikgym.trajectories import PublishedPath
from ikgym.trajectories.orientations import matrices
from ikgym.validation import FloatArray, float_array

#: Errors of the tool in [m] and [rad], and joint motions between waypoints in [rad], and in [m] of a prismatic joint,
#: that a passed problem stays below (Morgan, Millard and Sukhatme 2024).
POSITION, ORIENTATION, TURN, TRAVEL = 1e-4, np.radians(0.1), np.radians(7.0), 0.02


@dataclasses.dataclass(frozen=True)
class Verdict:
    """Errors, motions and clearance of a joint path at the waypoints of a problem."""

    position: float  # largest error in [m]
    orientation: float  # largest error in [rad]
    turn: float  # largest motion of a revolute joint between two waypoints, in [rad]
    travel: float  # likewise of a prismatic joint, in [m]
    within: bool  # whether the joints are within their limits
    clearance: float  # smallest signed distance between bodies in [m]; infinite where none can meet

    @property
    def followed(self) -> bool:
        """Whether the tool is on the path."""
        return self.position < POSITION and self.orientation < ORIENTATION

    @property
    def passed(self) -> bool:
        """Whether the path is followed in small joint motions, within the limits, and without a collision."""
        smooth = self.turn < TURN and self.travel < TRAVEL
        return self.followed and smooth and self.within and self.clearance > 0.0


def verdict(scenario: Scenario, q: FloatArray) -> Verdict:
    """Judges a joint path, by the bodies of our arms.

    Args:
        scenario: A scenario with a published path.
        q: Joint coordinates at its waypoints in [rad] or [m]. Shape (k, n).

    Raises:
        InvalidInputError: The scenario has no published path, or the joint path has another number of rows.
    """
    if not isinstance(scenario.trajectory, PublishedPath):
        raise InvalidInputError(f"Expected a scenario with a published path, got {scenario.name!r}.")
    arm, (positions, quaternions, *_) = scenario.arm, problems.get(scenario.trajectory.problem)
    path = float_array("q", q, (len(positions), arm.joints))
    rotations, there = arm.forward(path)
    angles = map(geodesic_angle, rotations, matrices(quaternions))
    endless = np.isinf(arm.upper - arm.lower)
    moved = np.abs(np.diff(path, axis=0))
    moved = np.where(endless, np.abs(np.remainder(moved + np.pi, 2.0 * np.pi) - np.pi), moved)
    sliding = arm.chain.prismatic
    return Verdict(
        position=float(np.linalg.norm(there - positions, axis=1).max()),
        orientation=float(max(angles)),
        turn=float(moved[:, ~sliding].max()),
        travel=float(moved[:, sliding].max(initial=0.0)),
        within=bool(((path >= arm.lower) & (path <= arm.upper)).all()),
        clearance=float(arm.clearance(path, scenario.obstacles)[0].min()),
    )
