"""Analytic policy gradient: the cost itself is differentiated, through the arm, over windows of some steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from baselines.agents.base_policy import SharedPreview, make_base_policy
from baselines.policy import Memory, Problem
from baselines.training.config.actor_only import APG
from baselines.training.randomness import sequence
from baselines.training.trainer import SegmentMetrics
from baselines.training.trainers.actor_only import ActorTrainer
from baselines.training.trainers.differentiable_arm import DifferentiableArm
from baselines.training.trainers.differentiable_policy import DifferentiablePolicy
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray


class _Arms:
    """N arms, each in an episode of its own, and the reference trajectories of these.

    Args:
        scenario: What is to be tracked.
        rows: N.
        ahead: The furthest step that is shown.
        memory: Of the base policy, at the start of episodes.
    """

    def __init__(self, scenario: Scenario, rows: int, ahead: int, memory: Memory) -> None:
        n, m = scenario.joints, scenario.task.size
        self._scenario, self._ahead, self._fresh = scenario, ahead, memory
        self.nominal = np.empty((rows, scenario.steps + ahead + 1, m))
        self.q, self.qdot = torch.zeros(rows, n, dtype=torch.float64), torch.zeros(rows, n, dtype=torch.float64)
        self.memory = tuple(array.copy() for array in memory)
        self.seed, self.made = np.zeros((2, rows), dtype=np.int64)
        #: Mean cost of the nominal joint path, and the cost of the episode and its steps so far.
        self.usual, self.spent, self.played = np.ones(rows), np.zeros(rows), np.zeros(rows)

    def begin(self, rows: npt.NDArray[np.int64], seeds: npt.NDArray[np.int64], at: npt.NDArray[np.int64]) -> None:
        """Begins episodes, or enters them where their nominal joint path is after some steps.

        Args:
            rows: Which arms. Shape (R,).
            seeds: Reset seeds. Shape (R,).
            at: Steps that are left out. Shape (R,).
        """
        q, qdot = self.q.detach().clone(), self.qdot.detach().clone()
        for row, seed, k in zip(rows.tolist(), seeds.tolist(), at.tolist(), strict=True):
            q[row], qdot[row] = torch.from_numpy(self._enter(row, seed, k)), 0.0
            self.seed[row], self.made[row], self.spent[row], self.played[row] = seed, k, 0.0, 0.0
        self.q, self.qdot = q, qdot
        for array, fresh in zip(self.memory, self._fresh, strict=True):
            array[rows] = fresh[rows]

    def state(self) -> dict[str, Any]:
        """Where they are."""
        numbers = {name: torch.from_numpy(getattr(self, name).copy()) for name in ("seed", "made", "spent", "played")}
        memory = [torch.from_numpy(array.copy()) for array in self.memory]
        return {"q": self.q.detach().clone(), "qdot": self.qdot.detach().clone(), "memory": memory, **numbers}

    def restore(self, state: dict[str, Any]) -> None:
        """Goes on from what :meth:`state` gave."""
        for row, seed in enumerate(state["seed"].tolist()):
            self._enter(row, seed, 0)
        self.q, self.qdot = state["q"].clone(), state["qdot"].clone()
        self.memory = tuple(tensor.numpy().copy() for tensor in state["memory"])
        for name in ("seed", "made", "spent", "played"):
            setattr(self, name, state[name].numpy().copy())

    def _enter(self, row: int, seed: int, k: int) -> FloatArray:
        """The reference trajectory of an arm's episode, and the joint coordinates to begin at."""
        scenario = self._scenario
        self.nominal[row] = scenario.nominal(seed, self._ahead)
        path = scenario.nominal_joint_path(seed)
        if path is None:
            self.usual[row] = 1.0
        else:
            usual = scenario.cost.velocity(np.diff(path, axis=0) / scenario.dt)
            self.usual[row] = float(np.mean(usual)) + 1e-3
        if k == 0 and (path is None or not scenario.starts_nominally):
            return scenario.first_q(scenario.episode(seed))
        if path is None:
            raise InvalidInputError(f"Scenario {scenario.name!r}: without a joint path, episodes begin at its start.")
        at: FloatArray = path[k]
        return at


class APGTrainer(ActorTrainer):
    """See :class:`APG`."""

    _config: APG

    def __init__(self, config: APG, scenario: Scenario, seed: int) -> None:
        super().__init__(config, scenario, seed)
        self._arm = DifferentiableArm(scenario)
        policy = make_base_policy(config.processing, Problem.of(scenario))
        self._base_policy = None if policy is None else DifferentiablePolicy(policy, scenario.arm)
        self._outlook = SharedPreview.of(config.processing, policy)
        self._counted = scenario.counted()
        rows, steps = config.n_envs, scenario.steps
        memory = () if policy is None else policy.memory(rows)
        self._arms = _Arms(scenario, rows, self._outlook.furthest, memory)
        # Spread over the episode, so that each step of Adam sees all parts of it.
        follows = scenario.nominal_joint_path(0) is not None
        first = np.arange(rows) * steps // rows if follows else np.zeros(rows, dtype=np.int64)
        self._arms.begin(np.arange(rows), self._seeds(np.random.default_rng(sequence(seed, None)), rows), first)

    def segment(self, number: int) -> SegmentMetrics:
        """See :meth:`baselines.training.trainer.Trainer.segment`."""
        generator = np.random.default_rng(sequence(self._seed, number))
        self._set_learning_rate(number)
        losses, refused = [], 0
        for _ in range(self._config.windows):
            loss, far = self._window(generator)
            refused += not self._descend(loss)
            losses.append(loss.item())
            arms = self._arms
            arms.q, arms.qdot = arms.q.detach(), arms.qdot.detach()
            self._renew(np.flatnonzero(far > self._config.reset_distance), generator)
            self.model.num_timesteps += self._config.n_envs * self._config.window
        self._finished()
        return {"train/loss": float(np.median(losses)), "train/refused": float(refused)}

    def state(self) -> dict[str, Any]:
        """See :meth:`baselines.training.trainer.Trainer.state`."""
        return {**super().state(), "arms": self._arms.state()}

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`baselines.training.trainer.Trainer.restore`."""
        super().restore(state)
        self._arms.restore(state["arms"])

    def _window(self, generator: np.random.Generator) -> tuple[Tensor, FloatArray]:
        """Moves all arms through a window.

        Returns:
            The loss, and the distance of each arm from its nominal position at the end, in [m], of shape (N,).
        """
        config, arms, every = self._config, self._arms, np.arange(self._config.n_envs)
        costs, weights = [], []
        for step in range(config.window):
            self._renew(np.flatnonzero(arms.made == self._scenario.steps), generator)
            arms.q, arms.qdot = self._move(arms.q, arms.qdot, with_gradient=step > 0)
            arms.made += 1
            error = self._arm.error(arms.q, arms.nominal[every, arms.made])
            cost = self._arm.stage_cost(error, arms.qdot) * torch.from_numpy(self._counted[arms.made].astype(float))
            arms.spent += cost.detach().numpy()
            arms.played += 1.0
            costs.append(cost)
            prior = config.cost_prior_steps
            weights.append((arms.played + prior) / (arms.spent + prior * arms.usual))
        weighed = torch.stack(costs) * torch.from_numpy(np.stack(weights))
        _, position = self._scenario.arm.forward(arms.q.detach().numpy())
        return weighed.mean(), np.linalg.norm(arms.nominal[every, arms.made, -3:] - position, axis=1)

    def _move(self, q: Tensor, qdot: Tensor, *, with_gradient: bool) -> tuple[Tensor, Tensor]:
        """One step of all arms; `with_gradient` says whether something before it has one."""
        config, arms = self._config, self._arms
        most = config.max_gradient_share / (config.n_envs * config.window)
        nominal = self._nominal(config.offsets)
        remaining = (self._scenario.steps - arms.made)[:, None].astype(np.float64)
        base = None
        if self._base_policy is not None:
            shown = self._nominal(range(1, self._outlook.base + 1))
            base, arms.memory = self._base_policy(q, qdot, shown, remaining, arms.memory, with_gradient=with_gradient)
        features, speed = self._arm.features(config.processing, q, qdot, nominal, remaining, base)
        output = self._outputs(features.float())
        output.register_hook(lambda gradient: _clipped(gradient, most))  # type: ignore[no-untyped-call]
        return self._arm.step(q, qdot, self._arm.action(config.processing, q, speed, output, base))

    def _nominal(self, ahead: Sequence[int]) -> FloatArray:
        """Nominal coordinates some steps ahead. Shape (N, p, m)."""
        arms = self._arms
        out: FloatArray = arms.nominal[np.arange(len(arms.made))[:, None], arms.made[:, None] + np.array(ahead)]
        return out

    def _renew(self, rows: npt.NDArray[np.int64], generator: np.random.Generator) -> None:
        if len(rows):
            self._arms.begin(rows, self._seeds(generator, len(rows)), np.zeros(len(rows), dtype=np.int64))

    @staticmethod
    def _seeds(generator: np.random.Generator, count: int) -> npt.NDArray[np.int64]:
        train = scenarios.SPLITS["train"]
        return generator.integers(train.start, train.stop, count)


def _clipped(gradient: Tensor, most: float) -> Tensor:
    """Gradients of network outputs, row by row no longer than a limit. Shapes (N, n)."""
    size: Tensor = gradient.norm(dim=1, keepdim=True)
    return gradient * (most / size.clamp(min=1e-30)).clamp(max=1.0)
