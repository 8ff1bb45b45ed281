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
