"""Wrappers for reinforcement learning, and environments that are wrapped by all of them.

>>> import ikgym.rl
>>> envs = ikgym.rl.make_vec("panda-random", num_envs=8)
"""

from ikgym.rl import vector
from ikgym.rl.making import Learning, make, make_vec
from ikgym.rl.wrappers import AgentObservation, History, LogReward, RelativeAction

__all__ = [
    "AgentObservation",
    "History",
    "Learning",
    "LogReward",
    "RelativeAction",
    "make",
    "make_vec",
    "vector",
]
