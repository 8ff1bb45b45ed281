"""Where the arms of `apg` begin new episodes: the tail of the costs is learned where it is met."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch

from baselines.training.gradients.arms import Arms, Indices, drawn_seeds
from ikgym.rl.twists import twist_size
from ikgym.scenarios import Scenario

#: Episodes that are kept to be played again, at most: those that cost most.
KEPT = 1024
#: Steps before the most singular posture of a reference joint path at which such an episode is entered: the way through
#: is decided some hundred steps before.
LEAD = 400
#: Steps between the postures that are looked at.
EVERY = 16


class Starts:
    """Draws the episodes that arms begin, and where they begin them.

    Args:
        scenario: What is to be tracked.
        replay_share: The share of episodes that are drawn from those that were lost or cost most so far, beside the
            mean cost of their reference joint paths: the k-th of them with a probability in proportion to 1/k
            (rank-based prioritisation, Schaul et al. 2016). The others are new.
        singular_share: The share of episodes that are entered :data:`LEAD` steps before the reference joint path is
            closest to a singularity. Where there is no such path they begin at their beginnings.
        start_noise: Standard deviation of the joint coordinates at first, off the path, in [rad] or [m].
    """

    def __init__(self, scenario: Scenario, replay_share: float, singular_share: float, start_noise: float) -> None:
        self._scenario, self._twist = scenario, int(twist_size(scenario.task.kind))
        self._replay_share, self._singular_share, self._start_noise = replay_share, singular_share, start_noise
        #: Cost of each episode beside its reference joint path, by its seed.
        self._costs: dict[int, float] = {}

    def note(self, arms: Arms, rows: Indices) -> None:
        """Remembers what episodes have cost that have ended, or whose track was lost.

        Args:
            arms: N arms.
            rows: Those that are meant. Shape (R,).
        """
        if self._replay_share == 0.0:
            return
        for seed, cost in zip(arms.seed[rows].tolist(), arms.cost_ratio[rows].tolist(), strict=True):
            # Half of what was known of it is forgotten, in logarithms: an episode that was lost is one to come back to.
            self._costs[seed] = math.sqrt(cost * self._costs.get(seed, cost))
        ranked = sorted(self._costs.items(), key=lambda item: -item[1])
        self._costs = dict(ranked[:KEPT])

    def renew(self, arms: Arms, rows: Indices, generator: np.random.Generator) -> None:
        """Begins episodes where others have ended.

        Args:
            arms: N arms.
            rows: Those that begin one. Shape (R,).
            generator: Draws episodes and starts; what is off draws nothing.
        """
        seeds, at = drawn_seeds(generator, len(rows)), np.zeros(len(rows), dtype=np.int64)
        if self._replay_share > 0.0 and self._costs:
            again = generator.random(len(rows)) < self._replay_share
            seeds = np.where(again, self._costly(len(rows), generator), seeds)
        if self._singular_share > 0.0:
            chosen = generator.random(len(rows)) < self._singular_share
            for i in np.flatnonzero(chosen):
                at[i] = self._before_a_singularity(int(seeds[i]))
        arms.begin(rows, seeds, at)
        if self._start_noise > 0.0:
            arms.displace(rows, generator.normal(0.0, self._start_noise, (len(rows), self._scenario.joints)))

    def state(self) -> dict[str, Any]:
        """What was seen of the costs so far."""
        seeds, costs = list(self._costs), list(self._costs.values())
        return {"seeds": torch.tensor(seeds, dtype=torch.int64), "costs": torch.tensor(costs, dtype=torch.float64)}

    def restore(self, state: dict[str, Any]) -> None:
        """Goes on from what :meth:`state` gave."""
        self._costs = dict(zip(state["seeds"].tolist(), state["costs"].tolist(), strict=True))

    def _costly(self, count: int, generator: np.random.Generator) -> Indices:
        """Seeds of costly episodes, the costliest most often. Shape (count,)."""
        weights = 1.0 / np.arange(1, len(self._costs) + 1)
        return generator.choice(np.array(list(self._costs), dtype=np.int64), count, p=weights / weights.sum())

    def _before_a_singularity(self, seed: int) -> int:
        path = self._scenario.nominal_joint_path(seed)
        if path is None:
            return 0
        jacobians = self._scenario.arm.jacobian(path[::EVERY])[:, : self._twist]
        smallest = np.linalg.svd(jacobians, compute_uv=False)[:, -1]
        return max(EVERY * int(np.argmin(smallest)) - LEAD, 0)
