"""The same paths for several arms, each in front of the arm and in proportion to it, and random motions.

Lengths are shares of the reach of the arm, speeds shares of it a second. What differs from arm to arm beyond that is
its :class:`ikgym.scenarios.workplaces.Workplace`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np

from ikgym import arms, tasks
from ikgym.arms import Arm
from ikgym.cost import TrackingCost
from ikgym.scenarios.scenario import Scenario
from ikgym.scenarios.workplaces import WORKPLACES, Workplace
from ikgym.trajectories import (
    AlongPath,
    FixedOrientation,
    JointSpline,
    PathTrajectory,
    Quintic,
    RandomJointSpline,
    TimeLaw,
    Trapezoidal,
    Turning,
    paths,
)
from ikgym.validation import FloatArray

# Episodes take full tenths of a second; at the end, arm and path stand.
TENTH = 0.1
# From knot to knot of the motion through singular postures, in [s], and how many knots lie between the two.
KNOT, BETWEEN = 0.12, 20
# Knots before the first of the postures and after the second.
BEFORE, AFTER = 5, 3
# So far from home are random motions at most, in [rad].
AROUND_HOME = 1.0


def _even(place: Workplace) -> TimeLaw:
    """Constant speed but for the ends."""
    return Trapezoidal(place.speed, place.acceleration)


def _smooth(place: Workplace) -> TimeLaw:
    """Continuous acceleration."""
    return Quintic(place.speed, place.acceleration)


def _round(place: Workplace) -> paths.Circle:
    return paths.Circle(place.center, 0.15 * place.reach, rotation=place.plane)


def _circle(place: Workplace) -> PathTrajectory:
    return PathTrajectory(_round(place), _smooth(place), FixedOrientation(place.tool))


def _lemniscate(place: Workplace) -> PathTrajectory:
    path = paths.Lemniscate(place.center, 0.2 * place.reach, rotation=place.plane)
    return PathTrajectory(path, _smooth(place), FixedOrientation(place.tool))


def _square(place: Workplace) -> PathTrajectory:
    path = paths.Square(place.center, 0.3 * place.reach, 0.04 * place.reach, rotation=place.plane)
    return PathTrajectory(path, _even(place), FixedOrientation(place.tool))


def _raster(place: Workplace) -> PathTrajectory:
    reach = place.reach
    path = paths.Raster(place.center, 0.35 * reach, 0.2 * reach, 4, 0.03 * reach, rotation=place.plane)
    return PathTrajectory(path, _even(place), FixedOrientation(place.tool))


def _line(place: Workplace) -> PathTrajectory:
    """Across the plane, while the tool turns by 30° about its normal."""
    half = 0.3 * place.reach * place.plane @ np.array([0.6, 0.8, 0.0])
    turning = Turning(place.tool, np.pi / 6.0 * place.plane[:, 2])
    return PathTrajectory(paths.Line(place.center - half, place.center + half), _even(place), turning)


def _turn(place: Workplace) -> PathTrajectory:
    """A short way, on which the tool turns about the axis of the last joint by more than that allows."""
    arm, half = arms.get(place.arm), 0.15 * place.reach * place.plane[:, 1]
    axis = place.tool @ arm.tool_rotation.T @ arm.axes[-1]
    path = paths.Line(place.center - half, place.center + half)
    return PathTrajectory(path, Quintic(0.5 * place.speed, place.acceleration), Turning(place.tool, place.turn * axis))


def _edge(place: Workplace) -> PathTrajectory:
    """A horizontal circle, whose farthest point is out of reach."""
    radius, beyond = 0.12 * place.reach, 0.04 * place.reach
    center = place.center + (place.edge + beyond - radius) * np.array([1.0, 0.0, 0.0])
    path = paths.Circle(center, radius, rotation=np.diag([-1.0, -1.0, 1.0]))
    return PathTrajectory(path, _smooth(place), FixedOrientation(place.tool))


def _fast(place: Workplace) -> PathTrajectory:
    """The circle of :func:`_circle`, faster than the joints can be."""
    speed = place.rush * place.reach
    return PathTrajectory(_round(place), Quintic(speed, 20.0 * place.rush * speed), FixedOrientation(place.tool))


def _glue(place: Workplace) -> PathTrajectory:
    """A horizontal square, the z axis of the tool upright; its x axis would follow the path, if it mattered."""
    path = paths.Square(place.center, 0.3 * place.reach, 0.06 * place.reach)
    approach = place.tool[:, 2]
    first = AlongPath(approach).rotations(path, np.zeros(1))[0]
    return PathTrajectory(path, _even(place), AlongPath(approach, first.T @ place.tool))


def _singular(place: Workplace) -> JointSpline:
    """Straight in joint space and with constant speed through both singular postures, which are knots."""
    share = np.arange(-BEFORE, BETWEEN + AFTER + 1)[:, None] / BETWEEN
    control = place.stretched + share * (place.aligned - place.stretched)
    return JointSpline(np.pad(control, ((2, 2), (0, 0)), mode="edge"), (len(control) + 1) * KNOT)


FAMILIES: dict[str, Callable[[Workplace], PathTrajectory | JointSpline]] = {
    "circle": _circle,
    "lemniscate": _lemniscate,
    "square": _square,
    "raster": _raster,
    "line": _line,
    "turn": _turn,
    "singular": _singular,
    "edge": _edge,
    "fast": _fast,
    "glue": _glue,
}


def _family(name: str, place: Workplace) -> Scenario:
    arm, trajectory = arms.get(place.arm), FAMILIES[name](place)
    tenths = math.ceil(trajectory.duration / TENTH - 1e-9)
    return Scenario(
        f"{place.arm}-{name}",
        arm,
        tasks.get("axis" if name == "glue" else "pose"),
        trajectory,
        cost=_cost(arm),
        dt=place.dt,
        steps=round(tenths * TENTH / place.dt),
        source="path of this project",
    )


def _random(name: str, **limits: float) -> Scenario:
    """Motions from rest to rest near home, where the elbow stays bent and the wrist is not aligned."""
    arm = arms.get(name)
    home: FloatArray = arm.home  # type: ignore[assignment]  # arms of makers have one
    lower, upper = np.maximum(arm.lower, home - AROUND_HOME), np.minimum(arm.upper, home + AROUND_HOME)
    return Scenario(
        f"{name}-random",
        arm,
        tasks.get("pose"),
        RandomJointSpline.within(arm, 2.0, lower=lower, upper=upper, **limits),
        cost=_cost(arm, p_x=2.0),
        dt=2e-3,
        steps=1000,
        source="random motion of this project",
    )


def _cost(arm: Arm, p_x: float = 3.0) -> TrackingCost:
    """1 for an error of 1 mm or 1 mrad, and for half of the speed of the slowest revolute joint."""
    slowest = float(arm.velocity_limit[~arm.chain.prismatic].min())
    return TrackingCost(p_x=p_x, delta_qdot=round(0.5 * slowest, 2))


SCENARIOS: dict[str, Callable[[], Scenario]] = {
    f"{place.arm}-{name}": functools.partial(_family, name, place) for place in WORKPLACES for name in FAMILIES
}
SCENARIOS["panda-random"] = functools.partial(_random, "panda")
# KUKA publishes no accelerations; the least of the Panda's is 7.5 rad/s².
SCENARIOS["iiwa14-random"] = functools.partial(_random, "iiwa14", acceleration_limit=7.5)
