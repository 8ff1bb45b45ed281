"""Wrappers for reinforcement learning, environments that are wrapped by them, and those by id.

>>> import ikgym.rl
>>> envs = ikgym.rl.make_vec("panda-random", num_envs=8)
"""

from ikgym.rl import vector
from ikgym.rl.ids import IDS
from ikgym.rl.making import Task, make, make_vec
from ikgym.rl.scoring import Score, costs, score
from ikgym.rl.wrappers import DistanceReward, History, ShareAction, TrackObservation

__all__ = [
    "IDS",
    "DistanceReward",
    "History",
    "Score",
    "ShareAction",
    "Task",
    "TrackObservation",
    "costs",
    "make",
    "make_vec",
    "score",
    "vector",
]
