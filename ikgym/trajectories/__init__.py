"""Nominal trajectories: motions in joint space, mapped through the model's kinematics, or paths in Cartesian space.

A trajectory is a function of time without an end. A random one is a distribution over trajectories: `sample` draws
one of them, and gives a fixed trajectory back as it is.
"""

from __future__ import annotations

from ikgym.trajectories import paths
from ikgym.trajectories.batch import JointMotions, first_joints_of, frames_of, joint_paths_of
from ikgym.trajectories.derived import JointPath, RetimedTrajectory
from ikgym.trajectories.helix import Helix
from ikgym.trajectories.joint_spline import JointSpline, RandomJointSpline
from ikgym.trajectories.orientations import AlongPath, FixedOrientation, OrientationThrough, Turning
from ikgym.trajectories.path_trajectory import PathTrajectory
from ikgym.trajectories.published_path import PublishedPath, RandomPublishedPath
from ikgym.trajectories.sinusoid import RandomSinusoid, Sinusoid
from ikgym.trajectories.straight_line import StraightLine
from ikgym.trajectories.time_laws import Quintic, TimeLaw, Trapezoidal
from ikgym.trajectories.timed_waypoints import TimedWaypoints
from ikgym.trajectories.trajectory import Trajectory
from ikgym.trajectories.waypoints import from_csv, through

__all__ = [
    "KINDS",
    "AlongPath",
    "FixedOrientation",
    "Helix",
    "JointMotions",
    "JointPath",
    "JointSpline",
    "OrientationThrough",
    "PathTrajectory",
    "PublishedPath",
    "Quintic",
    "RandomJointSpline",
    "RandomPublishedPath",
    "RandomSinusoid",
    "RetimedTrajectory",
    "Sinusoid",
    "StraightLine",
    "TimeLaw",
    "TimedWaypoints",
    "Trajectory",
    "Trapezoidal",
    "Turning",
    "first_joints_of",
    "frames_of",
    "from_csv",
    "joint_paths_of",
    "paths",
    "through",
]

#: The trajectories of this package by their names in scenario files.
KINDS: dict[str, type[Trajectory]] = {
    "sinusoid": Sinusoid,
    "random_sinusoid": RandomSinusoid,
    "joint_spline": JointSpline,
    "random_joint_spline": RandomJointSpline,
    "helix": Helix,
    "straight_line": StraightLine,
    "path": PathTrajectory,
    "timed_waypoints": TimedWaypoints,
    "published_path": PublishedPath,
    "random_published_path": RandomPublishedPath,
    "retimed": RetimedTrajectory,
    "joint_path": JointPath,
}
