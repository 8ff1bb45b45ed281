"""The trajectory log of an episode: what plots show of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.evaluation.rollout import Episode
from ikgym.scenarios import Scenario

#: Arrays by name, see :func:`trajectory_log`.
TrajectoryLog = dict[str, npt.NDArray[Any]]


def trajectory_log(scenario: Scenario, seed: int, episode: Episode) -> TrajectoryLog:
    """What plots show of an episode, at the steps that count.

    Args:
        scenario: What was tracked.
        seed: The reset seed.
        episode: What happened.

    Returns:
        ``time`` in [s], of shape (k,), and over it ``nominal`` and ``pose`` (k, m), ``q`` and ``qdot`` (k, n),
        ``position_error`` and, where there is one, ``orientation_error`` (k,); ``nominal_q`` (k, n) where there is a
        nominal joint path; ``prismatic`` says which joints are prismatic, ``lower``, ``upper`` and ``velocity_limit``
        what the arm is limited to, infinite where it is not, all of shape (n,). Where it has limits of acceleration,
        ``acceleration_limit`` (n,), and ``qddot`` (k, n): the change of q̇ in the step by Δt, from rest at the start.
    """
    after = np.flatnonzero(scenario.counted())
    kept = after - 1
    log: TrajectoryLog = {
        "time": after * scenario.dt,
        "nominal": scenario.nominal(seed)[after],
        "pose": episode.pose[kept],
        "q": episode.q[kept],
        "qdot": episode.qdot[kept],
        "position_error": episode.position_error[kept],
        "prismatic": np.array(scenario.arm.prismatic, dtype=np.bool_),
        "lower": scenario.arm.lower,
        "upper": scenario.arm.upper,
        "velocity_limit": scenario.arm.velocity_limit,
    }
    if scenario.task.has_orientation:
        log["orientation_error"] = episode.orientation_error[kept]
    if np.isfinite(scenario.arm.acceleration_limit).any():
        start = np.zeros((1, scenario.joints))
        log["qddot"] = (np.diff(episode.qdot, axis=0, prepend=start) / scenario.dt)[kept]
        log["acceleration_limit"] = scenario.arm.acceleration_limit
    path = scenario.nominal_joint_path(seed)
    if path is not None:
        log["nominal_q"] = path[after]
    return log
