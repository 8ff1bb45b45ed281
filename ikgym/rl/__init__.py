"""Environments for reinforcement learning, of any scenario and by id, and scores.

>>> import ikgym.rl
>>> envs = ikgym.rl.make_vec("panda-random", num_envs=8)
"""

from ikgym.rl.envs import LearningEnv, LearningVectorEnv, make, make_vec
from ikgym.rl.ids import IDS
from ikgym.rl.scoring import Score, costs, score
from ikgym.rl.task import Task

__all__ = ["IDS", "LearningEnv", "LearningVectorEnv", "Score", "Task", "costs", "make", "make_vec", "score"]
