"""Nominal trajectories: motions in joint space, mapped through the model's kinematics, or paths in Cartesian space.

A trajectory is a function of time without an end. A random one is a distribution over trajectories: `sample` draws
one of them, and gives a fixed trajectory back as it is.
"""

from __future__ import annotations

from ikgym.trajectories.batch import frames_of
from ikgym.trajectories.helix import Helix
from ikgym.trajectories.sinusoid import RandomSinusoid, Sinusoid
from ikgym.trajectories.straight_line import StraightLine
from ikgym.trajectories.trajectory import Trajectory

__all__ = ["KINDS", "Helix", "RandomSinusoid", "Sinusoid", "StraightLine", "Trajectory", "frames_of"]

#: The trajectories of this package by their names in scenario files.
KINDS: dict[str, type[Trajectory]] = {
    "sinusoid": Sinusoid,
    "random_sinusoid": RandomSinusoid,
    "helix": Helix,
    "straight_line": StraightLine,
}
