"""Analytic policy gradient: the cost itself is differentiated, through the arm, over windows of some steps."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from baselines.training.config.actor_only import APG
from baselines.training.gradients.arms import Arms
from baselines.training.gradients.law import Law
from baselines.training.gradients.starts import Starts
from baselines.training.networks import ActorModel
from baselines.training.randomness import sequence
from baselines.training.trainer import SegmentMetrics
from baselines.training.trainers.actor_only import ActorTrainer
from baselines.training.trainers.initial_weights import begin_actor_from
from ikgym.scenarios import Scenario

#: No gradient by a joint coordinate that still says anything is this long.
OVERFLOW = 1e30


class APGTrainer(ActorTrainer):
    """See :class:`APG`. The model is the average; the actor that Adam moves is one of its own."""

    _config: APG

    def __init__(self, config: APG, scenario: Scenario, seed: int) -> None:
        self._law = Law(scenario, config.processing)
        model = ActorModel.new((self._law.inputs, *config.hidden, self._law.outputs), config.activation)
        if config.init is not None:
            begin_actor_from(model.policy, config)
        super().__init__(config, scenario, seed, model, copy.deepcopy(model.policy))
        self._updates = 0
        self._arms = Arms(scenario, config.n_envs, config.offsets)
        self._starts = Starts(scenario, config.replay_share, config.singular_share, config.start_noise)
        self._farthest = config.reset_distance
        self.spread(np.random.default_rng(sequence(seed, None)))

    @property
    def actor(self) -> nn.Module:
        """What gradients are taken by; the model is its average."""
        return self._actor

    def spread(self, generator: np.random.Generator) -> None:
        """Begins new episodes, spread over their steps, so that each step of Adam sees all parts of them.

        Args:
            generator: Draws their seeds.
        """
        self._arms.spread(generator)
        self._far = np.zeros(self._config.n_envs)

    def segment(self, number: int) -> SegmentMetrics:
        """See :meth:`baselines.training.trainer.Trainer.segment`."""
        config, generator = self._config, np.random.default_rng(sequence(self._seed, number))
        self._set_learning_rate(number)
        losses, refused, lost = [], 0, 0
        window, self._farthest = config.window_of(number), config.reset_distance_of(number)
        for _ in range(config.segment_steps // window):
            loss, given_up = self.window(window, generator)
            refused += not self._descend(loss)
            self._average()
            losses.append(loss.item())
            lost += given_up
        self.model.num_timesteps += config.n_envs * config.segment_steps
        return {"train/loss": float(np.median(losses)), "train/refused": float(refused), "train/lost": float(lost)}

    def state(self) -> dict[str, Any]:
        """See :meth:`baselines.training.trainer.Trainer.state`."""
        actor, far = copy.deepcopy(self._actor.state_dict()), torch.from_numpy(self._far.copy())
        own = {"actor": actor, "updates": self._updates, "far": far}
        return {**super().state(), **own, "arms": self._arms.state(), "starts": self._starts.state()}

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`baselines.training.trainer.Trainer.restore`."""
        super().restore(state)
        self._actor.load_state_dict(state["actor"])
        self._updates, self._far = state["updates"], state["far"].numpy().copy()
        self._arms.restore(state["arms"])
        self._starts.restore(state["starts"])

    def window(self, steps: int, generator: np.random.Generator) -> tuple[Tensor, int]:
        """Moves all arms through a window, from where they are, of which no gradient is taken.

        All steps of an episode in it have the same weight, by what the episode has cost at its end. With weights by
        what it had cost before each step, the way into a costly passage would count far more than the passage.

        Args:
            steps: A multiple of `hold`.
            generator: Draws the seeds of new episodes.

        Returns:
            The loss, and how many arms were given up.
        """
        config, arms, total, given_up = self._config, self._arms, torch.zeros((), dtype=torch.float64), 0
        spent = torch.zeros(config.n_envs, dtype=torch.float64)  # in this window, each arm in its episode
        arms.q, arms.qdot = arms.q.detach(), arms.qdot.detach()
        most, precision = config.max_gradient_share * config.hold / (config.n_envs * steps), self._precision
        for _ in range(steps // config.hold):
            over = torch.from_numpy(self._lost | arms.ended)
            if over.any():
                total = total + arms.relative(spent, config.cost_prior_steps)[over].sum()
                spent = torch.where(over, 0.0, spent)
                given_up += self._renew(generator)
            q, qdot = _limited(arms.q, OVERFLOW), _limited(arms.qdot, OVERFLOW)
            features, speed = self._law.features(q, arms.ahead, arms.remaining)
            held = _limited(self._law.held(q, features, self._actor(features.to(precision)).double()), most)
            rows = arms.rows(config.hold, speed)
            arms.q, arms.qdot, cost, self._far = self._law.move(q, qdot, held, rows)
            arms.advance(rows.steps, cost)
            spent = spent + cost
        total = total + arms.relative(spent, config.cost_prior_steps).sum()
        return total / (config.n_envs * steps), given_up

    def _renew(self, generator: np.random.Generator) -> int:
        """Puts lost arms back, and begins new episodes where they are over; how many arms were lost."""
        lost, ended = self._lost, self._arms.ended
        over = np.flatnonzero(ended)
        self._starts.note(self._arms, np.flatnonzero(lost | ended))
        if (lost & ~ended).any():
            self._arms.give_up(np.flatnonzero(lost & ~ended))
        if len(over):
            self._starts.renew(self._arms, over, generator)
        return int(lost.sum())

    @property
    def _lost(self) -> npt.NDArray[np.bool_]:
        """Which arms are too far from their paths. Shape (N,)."""
        lost: npt.NDArray[np.bool_] = self._far > self._farthest
        return lost

    @property
    def _precision(self) -> torch.dtype:
        """Of the actor's weights."""
        return next(self._actor.parameters()).dtype

    def _average(self) -> None:
        """Lets the model follow the actor, at first faster."""
        kept = min(self._config.averaging, (1.0 + self._updates) / (10.0 + self._updates))
        self._updates += 1
        with torch.no_grad():
            for mean, weights in zip(self.model.policy.parameters(), self._actor.parameters(), strict=True):
                mean.lerp_(weights, 1.0 - kept)


def _limited(tensor: Tensor, most: float) -> Tensor:
    """The same numbers, whose gradients are cut row by row at a length; those that overflowed count as none."""

    def cut(gradient: Tensor) -> Tensor:
        finite = gradient.nan_to_num(0.0, 0.0, 0.0)
        size: Tensor = finite.norm(dim=1, keepdim=True)
        return finite * (most / size.clamp(min=1e-30)).clamp(max=1.0)

    out = tensor.view_as(tensor)
    if out.requires_grad:
        out.register_hook(cut)  # type: ignore[no-untyped-call]
    return out
