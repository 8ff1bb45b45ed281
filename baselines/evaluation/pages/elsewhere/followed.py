"""How well a joint path follows waypoints, and whether it passes CppFlow's thresholds."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ikgym.arms import Arm
from ikgym.problems import Waypoints
from ikgym.rotations import geodesic_angle
from ikgym.trajectories.orientations import matrices
from ikgym.validation import FloatArray

#: CppFlow's thresholds (`scripts/evaluate.py`): position in [m], orientation in [rad], and from waypoint to waypoint
#: the change of a revolute joint in [rad] and of a prismatic one in [m]. All of them have to be undercut.
POSITION, ORIENTATION, TURN, SLIDE = 1e-4, math.radians(0.1), math.radians(7.0), 0.02


@dataclasses.dataclass(frozen=True)
class Followed:
    """How a joint path follows waypoints. Changes of revolute joints are taken modulo 2π, as both sources do.

    Args:
        position_error: Largest distance from a waypoint, in [m].
        orientation_error: Largest geodesic angle to the orientation of a waypoint, in [rad].
        turn: Largest change of a revolute joint from waypoint to waypoint, in [rad].
        slide: Largest change of a prismatic joint from waypoint to waypoint, in [m].
        beyond: By how much a joint is outside its limits at most, in [rad] or [m]; 0 within.
        length: Changes of all revolute joints added up, in [rad].
    """

    position_error: float
    orientation_error: float
    turn: float
    slide: float
    beyond: float
    length: float

    @property
    def passes(self) -> bool:
        """Whether all thresholds are undercut and no limit is passed. Collisions are not looked at."""
        undercut = self.position_error < POSITION and self.orientation_error < ORIENTATION
        return undercut and self.turn < TURN and self.slide < SLIDE and self.beyond == 0.0


def followed(arm: Arm, q: FloatArray, waypoints: Waypoints) -> Followed:
    """How a joint path follows waypoints.

    Args:
        arm: The arm.
        q: Joint coordinates at the waypoints, in [rad] or [m]. Shape (k, n).
        waypoints: The k waypoints.
    """
    rotations, positions = arm.forward(q)
    wanted = matrices(waypoints.quaternions).reshape(-1, 3, 3)
    prismatic = np.array(arm.prismatic)
    changes = np.diff(q, axis=0)
    turns = np.abs(np.remainder(changes[:, ~prismatic] + np.pi, 2.0 * np.pi) - np.pi)
    slides = np.abs(changes[:, prismatic])
    return Followed(
        position_error=float(np.linalg.norm(positions - waypoints.positions, axis=1).max()),
        orientation_error=max(map(geodesic_angle, rotations, wanted)),
        turn=float(turns.max(initial=0.0)),
        slide=float(slides.max(initial=0.0)),
        beyond=float(np.maximum(np.maximum(arm.lower - q, q - arm.upper), 0.0).max()),
        length=float(turns.sum()),
    )
