"""Where arms work: what differs from arm to arm among the scenarios with the same paths."""

from __future__ import annotations

import dataclasses

import numpy as np

from ikgym.validation import FloatArray

DOWN = np.diag([1.0, -1.0, -1.0])
HORIZONTAL = np.eye(3)
#: Before the arm: x to the left, y up, and the normal towards the arm's front.
VERTICAL = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@dataclasses.dataclass(frozen=True, eq=False)
class Workplace:
    """Where an arm works, and how fast.

    Args:
        arm: The name of the arm.
        reach: As its maker states it, in [m].
        pace: Usual speed of the tool as a share of the reach, in [1/s].
        center: The middle of the paths in [m]. Shape (3,).
        tool: Orientation of the tool there. Shape (3, 3).
        plane: Its columns are the directions of x and y of the paths, and their normal. Shape (3, 3).
        turn: Angle about the axis of the last joint that a limit stands in the way of, in [rad].
        edge: From the center along the x axis of the base to where the reach ends with that orientation, in [m].
        rush: The share of the reach a second that no posture allows the tool, in [1/s].
        stretched: A singular posture with a stretched elbow, in [rad] or [m]. Shape (n,).
        aligned: A singular posture with an aligned wrist, in [rad] or [m]. Shape (n,).
        dt: Δt in [s].
    """

    arm: str
    reach: float
    pace: float
    center: FloatArray
    tool: FloatArray
    plane: FloatArray
    turn: float
    edge: float
    rush: float
    stretched: FloatArray
    aligned: FloatArray
    dt: float = 1e-3

    @property
    def speed(self) -> float:
        """Usual speed of the tool in [m/s]."""
        return self.pace * self.reach

    @property
    def acceleration(self) -> float:
        """Usual acceleration of the tool in [m/s²]: usual speed is reached in 1 / (12 pace)."""
        return 12.0 * self.pace * self.speed


#: Postures are singular to all digits that are given: the first has the shoulder, the elbow and the wrist on one line.
WORKPLACES = (
    Workplace(
        "panda",
        reach=0.855,
        pace=0.4,
        center=np.array([0.5, 0.0, 0.4]),
        tool=DOWN,
        plane=HORIZONTAL,
        turn=3.0,
        edge=0.285,
        rush=3.0,
        stretched=np.array([0.0, 0.4, 0.0, -0.467002, 0.0, 1.6, 0.785]),
        aligned=np.array([0.0, 0.2, 0.0, -1.8, 0.5 * np.pi, 3.374146, 0.785]),
    ),
    Workplace(
        "iiwa14",
        reach=0.82,
        pace=0.3,
        center=np.array([0.6, 0.0, 0.4]),
        tool=np.diag([-1.0, 1.0, -1.0]),
        plane=HORIZONTAL,
        turn=3.6,
        edge=0.2,
        rush=2.0,
        stretched=np.array([0.0, 0.5, 0.0, 0.0, 0.0, 1.0, 0.0]),
        aligned=np.array([0.0, 0.5, 0.0, -1.4, 0.5 * np.pi, 0.0, 0.0]),
    ),
    Workplace(
        "tiago",
        reach=0.87,
        pace=0.15,
        center=np.array([0.55, -0.2, 1.1]),
        tool=np.eye(3),
        plane=VERTICAL,
        turn=-2.8,
        edge=0.29,
        rush=2.0,
        stretched=np.array([0.15, 1.2, 0.0, -0.5 * np.pi, 0.144027, -0.7, -0.3, -0.5]),
        aligned=np.array([0.15, 1.2, 0.059291, -0.413658, 1.5, -0.025557, 0.0, -0.5]),
        dt=4e-3,
    ),
)
