"""ikgym: inverse kinematics of redundant arms as a Gymnasium environment.

>>> import gymnasium as gym
>>> import ikgym
>>> env = gym.make("RedundantIK-v0", scenario="varga7-fast")
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

import gymnasium as gym

from ikgym import arms, exceptions, obstacles, problems, scenarios, tasks, trajectories
from ikgym.arms import Arm
from ikgym.cost import ProximityCost, TrackingCost
from ikgym.exceptions import IkgymError
from ikgym.kernels import rotations
from ikgym.plant import Plant
from ikgym.scenarios import Scenario

if TYPE_CHECKING:
    from ikgym import rl
    from ikgym.env import RedundantIKEnv
    from ikgym.vector_env import RedundantIKVectorEnv

__all__ = [
    "Arm",
    "IkgymError",
    "Plant",
    "ProximityCost",
    "RedundantIKEnv",
    "RedundantIKVectorEnv",
    "Scenario",
    "TrackingCost",
    "arms",
    "exceptions",
    "obstacles",
    "problems",
    "rl",
    "rotations",
    "scenarios",
    "tasks",
    "trajectories",
]


__version__ = "0.2.0"

# Learning environments, see ikgym.rl.ids: steps of an episode, and the mean return at a score of 0.8, of
# ``python -m benchmarks.yardsticks``.
_LEARNING = {
    "Reach": (100, 79.0),
    "Track": (200, 197.6),
    "Fast": (200, 183.3),
    "Limits": (200, 189.2),
    "Camera": (300, 298.0),
    "Payload": (300, 285.2),
}


#: Names that are imported when they are first used, since solvers do not need them, and their modules.
_LATER = {"RedundantIKEnv": "env", "RedundantIKVectorEnv": "vector_env"}


def __getattr__(name: str) -> Any:
    if name == "rl":
        return importlib.import_module("ikgym.rl")
    if name in _LATER:
        return getattr(importlib.import_module(f"ikgym.{_LATER[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


if "RedundantIK-v0" not in gym.registry:
    gym.register(
        id="RedundantIK-v0",
        entry_point="ikgym.env:RedundantIKEnv",
        vector_entry_point="ikgym.vector_env:RedundantIKVectorEnv",
    )
    for _name, (_steps, _threshold) in _LEARNING.items():
        gym.register(
            id=f"ikgym/{_name}-v0",
            entry_point=f"ikgym.rl.ids:{_name}Env",
            vector_entry_point=f"ikgym.rl.ids:{_name.lower()}_arms",
            reward_threshold=_threshold,
            max_episode_steps=_steps,
        )
