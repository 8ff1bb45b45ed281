"""N arms, each in its episode, between segments."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from baselines.training.gradients.segment import Rows
from ikgym import scenarios
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

Indices = npt.NDArray[np.int64]

#: Interval, in steps, at which the mean cost of the reference joint path is sampled.
EVERY = 16
#: Added to that mean, which is 0 for an arm at rest.
LEAST = 1e-3


class Arms:
    """N arms, each in its episode, with its reference trajectory.

    Args:
        scenario: The scenario.
        rows: N.
        offsets: Steps ahead at which the reference is seen.
        hold: Largest number of steps of :meth:`rows`.
    """

    def __init__(self, scenario: Scenario, rows: int, offsets: tuple[int, ...], hold: int) -> None:
        n, m = scenario.joints, scenario.task.size
        self._scenario, self._offsets, self._furthest = scenario, np.array(offsets), max(offsets[-1], hold)
        self._counted = np.append(scenario.counted(), np.zeros(self._furthest, dtype=np.bool_))
        self._every = np.arange(rows)[:, None]
        self._nominal = np.empty((rows, scenario.steps + self._furthest + 1, m))
        # The reference joint path; NaN without one.
        self._path = np.full((rows, scenario.steps + 1, n), np.nan)
        self.q, self.qdot = torch.zeros(rows, n, dtype=torch.float64), torch.zeros(rows, n, dtype=torch.float64)
        self.seed, self.made = np.zeros((2, rows), dtype=np.int64)
        self.usual, self.spent, self.played = np.ones(rows), np.zeros(rows), np.zeros(rows)

    @property
    def ended(self) -> npt.NDArray[np.bool_]:
        """Whether each episode is over. Shape (N,)."""
        return self.made >= self._scenario.steps

    @property
    def remaining(self) -> FloatArray:
        """Steps left. Shape (N, 1)."""
        return (self._scenario.steps - self.made)[:, None].astype(np.float64)

    @property
    def ahead(self) -> FloatArray:
        """Reference task coordinates at the offsets. Shape (N, p, m)."""
        out: FloatArray = self._nominal[self._every, self.made[:, None] + self._offsets]
        return out

    def rows(self, steps: int, speed: FloatArray) -> Rows:
        """The input of a segment of K steps, with the speed s of each arm, of shape (N,)."""
        at = self.made[:, None] + np.arange(1, steps + 1)
        left = np.minimum(self._scenario.steps - self.made, steps)
        return Rows(self._nominal[self._every, at], self._counted[at], left, speed)

    def advance(self, steps: Indices, cost: Tensor) -> None:
        """Adds the steps and the cost of each arm in a segment. Shapes (N,)."""
        self.made += steps
        self.played += steps
        self.spent += cost.detach().numpy()

    def relative(self, cost: Tensor, prior: float) -> Tensor:
        """Costs ÷ the mean stage cost of the episodes so far.

        The mean counts as a constant: the gradient is that of its logarithm, times the steps.

        Args:
            cost: Of each arm. Shape (N,).
            prior: Weight of the mean cost of the reference joint path, in steps.

        Returns:
            Shape (N,).
        """
        return cost * torch.from_numpy((self.played + prior) / (self.spent + prior * self.usual))

    def begin(self, rows: Indices, generator: np.random.Generator, at: Indices | None = None) -> None:
        """Begins new episodes of the split `train`, or enters them on their reference joint path after some steps.

        Args:
            rows: Which arms. Shape (R,).
            generator: Draws the reset seeds.
            at: Steps that are skipped; none if left out. Shape (R,).
        """
        train = scenarios.SPLITS["train"]
        self._load(rows, generator.integers(train.start, train.stop, len(rows)))
        self._put(rows, np.zeros(len(rows), dtype=np.int64) if at is None else at)

    def spread(self, generator: np.random.Generator) -> None:
        """Begins a new episode for each arm, after other steps, so that an update sees all parts of one.

        Without a reference joint path, all episodes begin at step 0.
        """
        rows, scenario = np.arange(len(self.seed)), self._scenario
        follows = scenario.nominal_joint_path(scenarios.SPLITS["train"].start) is not None
        self.begin(rows, generator, rows * scenario.steps // len(rows) if follows else None)

    def give_up(self, rows: Indices) -> None:
        """Puts lost arms back on their reference joint paths, or to the start if there is none."""
        self._put(rows, np.where(self._follows[rows], self.made[rows], 0))

    def state(self) -> dict[str, Any]:
        """The state of all arms and episodes, to be saved."""
        numbers = {name: torch.from_numpy(getattr(self, name)) for name in ("seed", "made", "spent", "played")}
        return {"q": self.q.detach(), "qdot": self.qdot.detach(), **numbers}

    def restore(self, state: dict[str, Any]) -> None:
        """Continues from a :meth:`state` that was saved."""
        self._load(np.arange(len(self.seed)), state["seed"].numpy())
        self.q, self.qdot = state["q"], state["qdot"]
        for name in ("made", "spent", "played"):
            setattr(self, name, state[name].numpy())

    @property
    def _follows(self) -> npt.NDArray[np.bool_]:
        """Whether there is a reference joint path. Shape (N,)."""
        known: npt.NDArray[np.bool_] = ~np.isnan(self._path[:, 0, 0])
        return known

    def _put(self, rows: Indices, at: Indices) -> None:
        """Puts arms on their references after some steps, with the reference velocity; at rest at step 0."""
        q, qdot = self.q.detach().numpy().copy(), self.qdot.detach().numpy().copy()
        q[rows] = self._path[rows, at]
        qdot[rows] = (q[rows] - self._path[rows, np.maximum(at - 1, 0)]) / self._scenario.dt
        first = [row for row, k in zip(rows.tolist(), at.tolist(), strict=True) if k == 0]
        if first:
            episodes = [self._scenario.episode(int(self.seed[row])) for row in first]
            q[first], qdot[first] = self._scenario.first_q_of(episodes), 0.0
        self._replace(rows, q, qdot)
        self.made[rows], self.spent[rows], self.played[rows] = at, 0.0, 0.0

    def _replace(self, rows: Indices, q: FloatArray, qdot: FloatArray) -> None:
        """Sets the state of some arms; the others keep their gradients."""
        chosen = torch.zeros(len(q), 1, dtype=torch.bool)
        chosen[torch.from_numpy(rows)] = True
        self.q = torch.where(chosen, torch.from_numpy(q), self.q)
        self.qdot = torch.where(chosen, torch.from_numpy(qdot), self.qdot)

    def _load(self, rows: Indices, seeds: Indices) -> None:
        """Computes the references of the arms' episodes."""
        self.seed[rows] = seeds
        for row, seed in zip(rows.tolist(), seeds.tolist(), strict=True):
            self._load_row(row, seed)

    def _load_row(self, row: int, seed: int) -> None:
        """The reference of an arm's episode."""
        scenario = self._scenario
        self._nominal[row] = scenario.nominal(seed, self._furthest)
        path = scenario.nominal_joint_path(seed)
        if path is None:
            self._path[row], self.usual[row] = np.nan, 1.0
            return
        self._path[row] = path
        usual = scenario.cost.velocity((path[1::EVERY] - path[:-1:EVERY]) / scenario.dt)
        self.usual[row] = float(np.mean(usual)) + LEAST
