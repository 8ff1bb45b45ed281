"""Imitation: an agent learns what an expert does in the states that the agent gets into (DAgger, Ross et al. 2011)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from baselines import registry
from baselines.episodes import add_up
from baselines.episodes import play as play_episodes
from baselines.policy import Memory
from baselines.spec import parse_policy
from baselines.training.config.actor_only import Imitate
from baselines.training.environment.view import View
from baselines.training.randomness import episode_seed, sequence
from baselines.training.trainer import SegmentMetrics
from baselines.training.trainers.actor_only import ActorTrainer
from baselines.training.trainers.models import network_outputs
from baselines.training.trainers.students import Student, student
from ikgym.outcome import observation
from ikgym.preview import furthest, offsets
from ikgym.scenarios import Preview, Scenario
from ikgym.simulation import Outcome
from ikgym.validation import FloatArray


class Examples(NamedTuple):
    """What is learned from, as float32 unless it says otherwise.

    Attributes:
        features: Shape (N, f).
        target: What the student should say for the expert's actions. Shape (N, n).
        given: What it says depends on this, too, see :class:`Student`; float64. Shape (N, k).
    """

    features: Tensor
    target: Tensor
    given: Tensor


class ImitateTrainer(ActorTrainer):
    """See :class:`Imitate`."""

    _config: Imitate

    def __init__(self, config: Imitate, scenario: Scenario, seed: int) -> None:
        self._student = student(config, scenario)
        super().__init__(config, scenario, seed, self._student.model, self._student.actor)
        name, parameters = parse_policy(config.expert)
        self._expert = registry.make(name, scenario, **parameters)
        view = View(self._student.processing, scenario)
        self._ahead = max(furthest(view.preview), furthest(self._expert.preview))
        self._examples: Examples | None = None

    def segment(self, number: int) -> SegmentMetrics:
        """See :meth:`baselines.training.trainer.Trainer.segment`."""
        self._set_learning_rate(number)
        generator = np.random.default_rng(sequence(self._seed, number))
        fresh, cost = self._play(number, generator)
        old = self._examples
        newest = slice(-self._config.buffer_size, None)
        joined = fresh if old is None else Examples(*[torch.cat(pair) for pair in zip(old, fresh, strict=True)])
        self._examples = Examples(*[part[newest].clone() for part in joined])
        losses = [self._learn() for _ in range(self._config.gradient_steps)]
        self._student.finished()
        return {"train/loss": float(np.mean(losses)), "train/cost": cost}

    def state(self) -> dict[str, Any]:
        """See :meth:`baselines.training.trainer.Trainer.state`."""
        return {**super().state(), "examples": None if self._examples is None else list(self._examples)}

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`baselines.training.trainer.Trainer.restore`."""
        super().restore(state)
        self._examples = None if state["examples"] is None else Examples(*state["examples"])

    def _play(self, number: int, generator: np.random.Generator) -> tuple[Examples, float]:
        """Plays episodes, and asks the expert in all states.

        Returns:
            Examples, and the geometric mean of the costs.
        """
        config, scenario = self._config, self._scenario
        first = episode_seed(self._seed, number, config.n_envs)
        seeds = range(first, first + config.n_envs)
        by_expert = np.ones(len(seeds), dtype=np.bool_) if number == 0 else generator.random(len(seeds)) < config.beta
        mixture = _Mixture(self, by_expert, generator)
        costs = np.empty((len(seeds), scenario.steps))
        for k, out in enumerate(play_episodes(scenario, seeds, mixture.act, preview=self._ahead)):
            costs[:, k] = out.tracking_cost + out.velocity_cost
        self.model.num_timesteps += costs.size
        mean = float(np.exp(np.mean(np.log(np.maximum(add_up(costs), 1e-300)))))
        return mixture.examples(), mean

    def _learn(self) -> float:
        """One gradient step on the Cauchy loss ln(1 + |error|² / tolerance²).

        Where the expert does now this and now that, errors stay large; in this loss they hardly count.
        """
        assert self._examples is not None
        chosen = torch.randint(len(self._examples.features), (self._config.batch_size,))
        features, target, given = (part[chosen] for part in self._examples)
        error = self._student.said(features, given) - target
        loss = (error.square().sum(1) / self._config.tolerance**2).log1p().mean()
        self._descend(loss)
        return loss.item()


class _Mixture:
    """DAgger's mixture of expert and agent: it moves arms, and keeps what the expert would have done.

    Args:
        trainer: Whose agent it is.
        by_expert: Arms that the expert moves. Shape (N,).
        generator: Draws the noise of these arms.
    """

    def __init__(
        self, trainer: ImitateTrainer, by_expert: npt.NDArray[np.bool_], generator: np.random.Generator
    ) -> None:
        self._config, self._student, self._expert = trainer._config, trainer._student, trainer._expert
        scenario, rows = trainer._scenario, len(by_expert)
        self._view = View(self._student.processing, scenario)
        self._by_expert = by_expert
        size = self._config.expert_noise * generator.random(rows)
        self._noise = _Noise(size, generator, scenario.joints)
        self._memory: Memory | None = None
        self._step = 0
        self._parts: list[tuple[npt.NDArray[Any], ...]] = []

    def act(self, out: Outcome) -> npt.NDArray[Any]:
        """The actions of a step. Shape (N, n)."""
        config = self._config
        seen = observation(out)
        mine, its = (seen | {"nominal": _shown(out.nominal, each.preview)} for each in (self._view, self._expert))
        features = self._view.see(mine, np.full(len(out.q), self._step == 0))
        right, self._memory = self._expert.predict(its, self._memory)
        if self._step % config.example_every == 0:
            example = self._student.example(self._view.batch, right, self._view.base)
            self._parts.append((features.copy(), *example))
        self._step += 1
        moved = right + self._noise.next(self._student, out.q, right)
        own = self._view.act(network_outputs(self._student.model, features))
        follows = self._by_expert | (out.position_error > config.intervention_distance)
        return np.where(follows[:, None], moved, own)

    def examples(self) -> Examples:
        """What the expert would have done."""
        return Examples(*[torch.from_numpy(np.concatenate(part)) for part in zip(*self._parts, strict=True)])


def _shown(nominal: FloatArray, preview: Preview) -> FloatArray:
    """What a policy sees of the nominal coordinates ahead."""
    return np.ascontiguousarray(nominal[:, np.array(offsets(preview)) - 1])


class _Noise:
    """Correlated noise, of another size and correlation time in each row."""

    def __init__(self, size: FloatArray, generator: np.random.Generator, joints: int) -> None:
        self._size, self._generator = size, generator
        self._kept = np.where(np.arange(len(size)) % 2, 0.98, 0.997)[:, None]
        self._value = np.zeros((len(size), joints))

    def next(self, student: Student, q: FloatArray, action: npt.NDArray[Any]) -> FloatArray:
        """What is added to actions. Shapes (N, n)."""
        fresh = self._generator.normal(size=self._value.shape)
        self._value = self._kept * self._value + np.sqrt(1.0 - self._kept**2) * fresh
        out: FloatArray = self._size[:, None] * np.abs(action).max(1, keepdims=True) * student.projected(q, self._value)
        return out
