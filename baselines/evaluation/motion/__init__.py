"""The joint motion of an episode, as it was played and as messages that a controller accepts."""

from baselines.evaluation.motion.message import joint_trajectory, mcap
from baselines.evaluation.motion.played import Motion

__all__ = ["Motion", "joint_trajectory", "mcap"]
