"""ikgym: inverse kinematics of redundant arms as a Gymnasium environment.

>>> import gymnasium as gym
>>> import ikgym
>>> env = gym.make("RedundantIK-v0", scenario="varga7-fast")
"""

from __future__ import annotations

import gymnasium as gym

from ikgym import arms, exceptions, obstacles, problems, rl, scenarios, tasks, trajectories
from ikgym.arms import Arm
from ikgym.cost import ProximityCost, TrackingCost
from ikgym.env import RedundantIKEnv
from ikgym.exceptions import IkgymError
from ikgym.kernels import rotations
from ikgym.plant import Plant
from ikgym.scenarios import Scenario
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

if "RedundantIK-v0" not in gym.registry:
    gym.register(
        id="RedundantIK-v0",
        entry_point="ikgym.env:RedundantIKEnv",
        vector_entry_point="ikgym.vector_env:RedundantIKVectorEnv",
    )
    rl.ids.register()
