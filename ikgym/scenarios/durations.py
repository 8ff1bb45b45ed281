"""How long a path takes, and how many steps an episode that follows it."""

from __future__ import annotations

import math

from ikgym.trajectories import Trajectory

#: Steps of an episode whose trajectory goes on for ever, or is drawn.
USUAL_STEPS = 1000
#: Rest after the end of a path, in [s], in an episode that states no steps.
REST = 0.25


def duration(trajectory: Trajectory) -> float | None:
    """The time from rest to rest in [s]; None for a trajectory that goes on for ever, or is drawn."""
    return None if trajectory.random else getattr(trajectory, "duration", None)


def default_steps(trajectory: Trajectory, dt: float, held: tuple[int, ...]) -> int:
    """Steps for a whole path and a short rest, at least one step; :data:`USUAL_STEPS` where there is no end.

    Nominal points 1, 2, … are held for so many steps, the last number for all later ones.
    """
    time = duration(trajectory)
    if time is None:
        return USUAL_STEPS
    points = math.ceil(time / dt - 1e-9) + math.ceil(REST / dt)
    return sum(held[:points]) + max(points - len(held), 0) * held[-1]
