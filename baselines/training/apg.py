"""Analytic policy gradient: the cost is differentiated through the arm, over windows of some steps."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from baselines.agents.files import AgentFile, agent_of
from baselines.training.exporting import ACTIVATIONS, runtime
from baselines.training.gradients.arms import Arms
from baselines.training.gradients.law import Law
from baselines.training.options import APG
from ikgym.scenarios import Scenario

#: Factor of the first weights of the last layer.
QUIET = 0.01
#: Norm at which gradients with respect to joint coordinates are clipped: longer ones have overflowed.
OVERFLOW = 1e30


class Trainer:
    """Trains an agent, segment by segment.

    A segment depends on nothing but the seed, its number and :meth:`state`: a run that was killed and resumed ends with
    the same weights, bit for bit.

    Attributes:
        policy: The network that is evaluated and kept: the average of the actor, whose weights Adam changes.
        steps: Steps of the environment so far, summed over all arms.

    Args:
        config: The options.
        scenario: The scenario to train on.
        seed: The seed of the run.

    Raises:
        InvalidInputError: The scenario's plant is not ideal.
    """

    def __init__(self, config: APG, scenario: Scenario, seed: int) -> None:
        self._law = Law(scenario, config.processing)
        torch.manual_seed(_sequence(seed, 0).generate_state(3).tolist()[2])
        policy = new_actor((self._law.inputs, *config.hidden, self._law.outputs), config.activation)
        self._config, self._scenario, self._seed = config, scenario, seed
        self.policy, self._actor, self.steps = policy, copy.deepcopy(policy), 0
        self._adam = torch.optim.Adam(self._actor.parameters(), lr=config.learning_rate)
        self._updates = 0
        self._arms = Arms(scenario, config.n_envs, config.offsets, config.hold)
        self._farthest = config.reset_distance
        self._arms.spread(np.random.default_rng(_sequence(seed, 0)))
        self._far = np.zeros(config.n_envs)

    def segment(self, number: int) -> dict[str, float]:
        """Trains for one segment, counted from 0; returns its metrics."""
        config, generator = self._config, np.random.default_rng(_sequence(self._seed, number + 1))
        window, self._farthest, rate = config.schedule(number)
        for group in self._adam.param_groups:
            group["lr"] = rate
        losses, refused, lost = [], 0, 0
        for _ in range(config.segment_steps // window):
            loss, given_up = self.window(window, generator)
            refused += not self._descend(loss)
            self._average()
            losses.append(loss.item())
            lost += given_up
        self.steps += config.n_envs * config.segment_steps
        return {"train/loss": float(np.median(losses)), "train/refused": float(refused), "train/lost": float(lost)}

    def agent(self, training: dict[str, Any] | None = None) -> AgentFile:
        """The agent with the present weights of `policy`; `training` says how it was trained, as JSON values."""
        network = runtime(list(self.policy), "linear")
        return agent_of(network, self._config.processing, self._scenario, training)

    def state(self) -> dict[str, Any]:
        """All that later segments depend on: tensors, numbers, strings, and lists and dicts of them, to be saved."""
        weights = {name: part.state_dict() for name, part in self._parts.items()}
        numbers = {"steps": self.steps, "updates": self._updates, "far": torch.from_numpy(self._far)}
        return {**weights, **numbers, "arms": self._arms.state()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continues from a :meth:`state` that was saved."""
        for name, part in self._parts.items():
            part.load_state_dict(state[name])
        self.steps, self._updates, self._far = state["steps"], state["updates"], state["far"].numpy()
        self._arms.restore(state["arms"])

    @property
    def _parts(self) -> dict[str, Any]:
        return {"policy": self.policy, "adam": self._adam, "actor": self._actor}

    def window(self, steps: int, generator: np.random.Generator) -> tuple[Tensor, int]:
        """Moves all arms through a window; their states at its start are constants for the gradient.

        All steps of an episode in it have the same weight, from the cost of the episode at the end of the window.
        Weights from the cost before each step would favour the approach to a costly passage over the passage itself.

        Args:
            steps: A multiple of `hold`.
            generator: Draws the seeds of new episodes.

        Returns:
            The loss, and how many arms were lost.
        """
        config, arms, total, given_up = self._config, self._arms, torch.zeros((), dtype=torch.float64), 0
        spent = torch.zeros(config.n_envs, dtype=torch.float64)  # in this window, each arm in its episode
        arms.q, arms.qdot = arms.q.detach(), arms.qdot.detach()
        most = config.max_gradient_share * config.hold / (config.n_envs * steps)
        precision = next(self._actor.parameters()).dtype
        for _ in range(steps // config.hold):
            over = torch.from_numpy(self._lost | arms.ended)
            if over.any():
                total = total + arms.relative(spent, config.cost_prior_steps)[over].sum()
                spent = torch.where(over, 0.0, spent)
                given_up += self._renew(generator)
            q, qdot = _clip_gradients(arms.q, OVERFLOW), _clip_gradients(arms.qdot, OVERFLOW)
            features, speed = self._law.features(q, arms.ahead, arms.remaining)
            held = _clip_gradients(self._law.gains(q, features, self._actor(features.to(precision)).double()), most)
            rows = arms.rows(config.hold, speed)
            arms.q, arms.qdot, cost, self._far = self._law.move(q, qdot, held, rows)
            arms.advance(rows.steps, cost)
            spent = spent + cost
        total = total + arms.relative(spent, config.cost_prior_steps).sum()
        return total / (config.n_envs * steps), given_up

    def _renew(self, generator: np.random.Generator) -> int:
        """Puts lost arms back and begins new episodes where one has ended; returns how many arms were lost."""
        lost, ended = self._lost, self._arms.ended
        if (lost & ~ended).any():
            self._arms.give_up(np.flatnonzero(lost & ~ended))
        if ended.any():
            self._arms.begin(np.flatnonzero(ended), generator)
        return int(lost.sum())

    @property
    def _lost(self) -> npt.NDArray[np.bool_]:
        """Which arms are too far from their references. Shape (N,)."""
        lost: npt.NDArray[np.bool_] = self._far > self._farthest
        return lost

    def _descend(self, loss: Tensor) -> bool:
        """One step of Adam; False, and no step, if the gradient is not finite."""
        self._adam.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        size = nn.utils.clip_grad_norm_(self._actor.parameters(), self._config.max_grad_norm)
        finite = bool(torch.isfinite(size))
        if finite:
            self._adam.step()
        return finite

    def _average(self) -> None:
        """Moves the average towards the actor, faster at first."""
        kept = min(self._config.averaging, (1.0 + self._updates) / (10.0 + self._updates))
        self._updates += 1
        with torch.no_grad():
            for mean, weights in zip(self.policy.parameters(), self._actor.parameters(), strict=True):
                mean.lerp_(weights, 1.0 - kept)


def _clip_gradients(tensor: Tensor, most: float) -> Tensor:
    """The same tensor, with gradients clipped row by row at a norm; gradients that overflowed count as 0."""

    def cut(gradient: Tensor) -> Tensor:
        finite = gradient.nan_to_num(0.0, 0.0, 0.0)
        size: Tensor = finite.norm(dim=1, keepdim=True)
        return finite * (most / size.clamp(min=1e-30)).clamp(max=1.0)

    out = tensor.view_as(tensor)
    if out.requires_grad:
        out.register_hook(cut)  # type: ignore[no-untyped-call]
    return out


def new_actor(sizes: Sequence[int], activation: str) -> nn.Sequential:
    """Linear layers with activations between them, whose first outputs are almost 0."""
    layers = [nn.Linear(inputs, outputs) for inputs, outputs in itertools.pairwise(sizes)]
    with torch.no_grad():
        layers[-1].weight.mul_(QUIET)
        layers[-1].bias.zero_()
    hidden = [module for layer in layers[:-1] for module in (layer, ACTIVATIONS[activation]())]
    return nn.Sequential(*hidden, layers[-1])


def _sequence(seed: int, part: int) -> np.random.SeedSequence:
    """The randomness of a part of a run: 0 is before the first segment, n is segment n."""
    return np.random.SeedSequence(seed, spawn_key=(part,))
