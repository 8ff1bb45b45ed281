"""Policies whose package may be missing, and scenarios of real arms that suit them."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.registry import get
from ikgym.exceptions import MissingDependencyError
from ikgym.trajectories import FixedOrientation, PathTrajectory, Quintic
from ikgym.trajectories.paths import Circle


def usual(name):
    """A scenario that suits a policy: solvers of other projects know no skew coordinates, an agent only its arm."""
    if name == "agent_track":
        return "panda-circle"
    return "zhang6-lspb" if get(name).rival else "varga7-fast"


#: A short search: a contract asks for some path, what a thorough one finds is for the tests of the oracle.
SHORT = {"oracle": {"starts": 4, "generations": 1}}


def made(name, on, **parameters):
    """The policy; where its package is not installed the test is skipped and says so."""
    try:
        return baselines.make(name, on, **SHORT.get(name, {}) | parameters)
    except MissingDependencyError as e:
        assert get(name).rival
        pytest.skip(str(e))


def two_actions(name):
    """The last of two actions of a policy on its usual scenario."""
    scenario = ikgym.scenarios.get(usual(name)).replace(steps=3)
    policy, state = baselines.make(name, scenario), None
    env = ikgym.RedundantIKEnv(scenario, preview=policy.preview)
    observation, _ = env.reset(seed=0)
    for _ in range(2):
        action, state = policy.predict(observation, state)
        observation = env.step(action)[0]
    return action.tolist()


def circle(arm="panda", dt=2e-3, task="pose", speed=0.25, steps=400, **changes):
    """A circle of 10 cm in front of an arm, from its home; changes are those of the arm."""
    arm = ikgym.arms.get(arm).replace(**changes)
    rotation, position = arm.forward(arm.home)
    across = np.eye(3)[[1, 2, 0]].T
    path = Circle(center=position - [0.0, 0.1, 0.0], radius=0.1, rotation=across)
    trajectory = PathTrajectory(path, Quintic(speed, 2.0), FixedOrientation(rotation))
    return ikgym.Scenario(
        name=f"circle-{task}",
        arm=arm,
        trajectory=trajectory,
        task=ikgym.tasks.get(task),
        dt=dt,
        steps=steps,
        start=arm.home,
    )
