"""A Panda with bodies and obstacles around it, for tests of what is shown and reported."""

import numpy as np

import ikgym
from ikgym.obstacles import Box, Capsule, HalfSpace, Sphere
from ikgym.trajectories import StraightLine

UPRIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
BALL = Sphere(
    "ball", [0, 0, 0], 0.09, motion=StraightLine([*UPRIGHT, 1.1, 0.4, 0.6], [*UPRIGHT, 0.7, 0.5, 0.6], 1.0, 0.2)
)
AROUND = (
    HalfSpace("floor", [0, 0, -0.06], [0, 0, 1]),
    Box("box", [0.5, -0.6, 0.2], [0.2, 0.15, 0.4], [[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]]),
    BALL,
    Capsule("pipe", [0.95, -0.3, 0.8], [0.95, 0.3, 0.8], 0.04),
)


def line(way, duration):
    """A motion from the base frame along a straight line."""
    return StraightLine([*UPRIGHT, 0, 0, 0], [*UPRIGHT, *way], duration=duration, blend=0.1)


PERSON = Capsule("person", [0, 0.5, 0], [0, 0.5, 1], 0.1, motion=line([0.4, -0.3, 0], 0.5))
POST = Box("post", [0.35, 0.12, 0.2], [0.05, 0.05, 0.7])


def crowd(steps=60, obstacles=AROUND, name="panda-crowd"):
    """The circle of a Panda among obstacles of all kinds."""
    return ikgym.scenarios.get("panda-circle").replace(name=name, obstacles=obstacles, steps=steps)


def ball_in_the_way(arm, q):
    """A ball of 5 cm that the elbow of a Panda goes some millimetres into, towards the end of a joint path (k, n)."""
    before, after = (arm.joint_points(posture)[3, 0] for posture in (q[0], q[-1]))
    ahead = (after - before) / np.linalg.norm(after - before)
    balls = (Sphere("ball", after + shift * ahead, 0.05) for shift in np.linspace(0.2, 0.0, 401))
    return next(ball for ball in balls if arm.clearance(q, [ball])[0].min() < -2e-3)


def blocked(steps=1500):
    """The same path with a post where the arm has to pass."""
    return crowd(steps, (AROUND[0], POST), "panda-blocked")


def wild(rows, steps):
    """Actions that lead joints somewhere, one arm another way than the next."""
    rng = np.random.default_rng(0)
    drift = rng.uniform(-1, 1, (1, rows, 7))
    return np.clip(drift + 0.3 * rng.normal(size=(steps, rows, 7)), -1, 1).astype(np.float32)
