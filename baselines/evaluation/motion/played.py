"""The joint motion of an episode as it was played."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from baselines.recording import Episode, Seeds
from ikgym.arms import Arm
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray


class Motion(NamedTuple):
    """The joint motion of an episode, from its start."""

    times: FloatArray  # from 0, in [s]. Shape (steps + 1,)
    q: FloatArray  # joint coordinates at these times, in [rad] or [m]. Shape (steps + 1, n)
    # joint velocities of the step that ends then, 0 at the start, in [rad/s] or [m/s]. Shape (steps + 1, n)
    qdot: FloatArray

    @classmethod
    def of(cls, scenario: Scenario, seeds: Seeds, episode: Episode) -> Motion:
        """The motion of an episode."""
        q = np.vstack([scenario.start_of(seeds.seed, seeds.arm_seed), episode.q])
        return cls(scenario.times(scenario.steps + 1), q, np.vstack([np.zeros(scenario.joints), episode.qdot]))

    @property
    def qddot(self) -> FloatArray:
        """Change of the velocity in the step that ends then by Δt, in [rad/s²] or [m/s²]. Shape (steps + 1, n)."""
        out: FloatArray = np.diff(self.qdot, axis=0, prepend=self.qdot[:1]) / (self.times[1] - self.times[0])
        return out


def by_joint(arm: Arm, values: FloatArray, per: str = "") -> dict[str, FloatArray]:
    """Columns of a table by joint and unit, of values (k, n); `per` follows the unit of the joint, such as ``/s``."""
    units = ["m" if prismatic else "rad" for prismatic in arm.prismatic]
    heads = [f"{name} [{unit}{per}]" for name, unit in zip(arm.joint_names, units, strict=True)]
    return dict(zip(heads, values.T, strict=True))
