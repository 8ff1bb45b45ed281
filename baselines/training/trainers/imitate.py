"""Imitation: an agent learns what an expert does in the states that the agent gets into (DAgger, Ross et al. 2011)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from baselines import registry
from baselines.agents.features import project_rows, speed_rows
from baselines.episode import added_up
from baselines.episode import play as play_episodes
from baselines.policy import Memory, Problem
from baselines.spec import parse_policy
from baselines.training.config.actor_only import Imitate
from baselines.training.environment.vec_env import ProcessedVecEnv
from baselines.training.environment.view import View
from baselines.training.randomness import episode_seed, sequence
from baselines.training.trainer import SegmentMetrics
from baselines.training.trainers.actor_only import ActorTrainer
from baselines.training.trainers.initial_weights import begin_from
from baselines.training.trainers.models import mean_network, network_outputs, new_model, squash_of
from ikgym.outcome import observation
from ikgym.preview import furthest, offsets
from ikgym.scenarios import Scenario
from ikgym.simulation import Outcome
from ikgym.validation import FloatArray

#: From joint coordinates and velocities to the velocities that network outputs can make. Shapes (N, n).
Projector = Callable[[FloatArray, FloatArray], FloatArray]


class Examples(NamedTuple):
    """What is learned from, as float32.

    Attributes:
        features: Shape (N, f).
        target: Network outputs that would be the expert's actions. Shape (N, n).
    """

    features: Tensor
    target: Tensor


class ImitateTrainer(ActorTrainer):
    """See :class:`Imitate`."""

    _config: Imitate

    def __init__(self, config: Imitate, scenario: Scenario, seed: int) -> None:
        env = ProcessedVecEnv(1, scenario, config.velocities)
        model = new_model(config.algorithm, env, config.hidden, config.activation)
        if config.init is not None:
            begin_from(model, config)
        super().__init__(config, scenario, seed, model, mean_network(model))
        self._squashed = squash_of(config.algorithm)
        name, parameters = parse_policy(config.expert)
        self._expert = registry.make(name, scenario, **parameters)
        view = View(config.velocities, scenario)
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
        self._finished()
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
        mean = float(np.exp(np.mean(np.log(np.maximum(added_up(costs), 1e-300)))))
        return mixture.examples(), mean

    def _outputs(self, features: Tensor) -> Tensor:
        """The actor's outputs, with gradients. Shapes (N, f) and (N, n), float32."""
        mean: Tensor = self._actor(features)
        return mean.tanh() if self._squashed == "tanh" else mean

    def _finished(self) -> None:
        """Lets all that copies the actor follow it."""
        target = getattr(self.model.policy, "actor_target", None)
        if target is not None:
            target.load_state_dict(self.model.policy.actor.state_dict())

    def _learn(self) -> float:
        """One gradient step on the Cauchy loss ln(1 + |error|² / tolerance²).

        Where the expert does now this and now that, errors stay large; in this loss they hardly count.
        """
        assert self._examples is not None
        chosen = torch.randint(len(self._examples.features), (self._config.batch_size,))
        error = self._outputs(self._examples.features[chosen]) - self._examples.target[chosen]
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
        self._config, self._model, self._expert = trainer._config, trainer.model, trainer._expert
        scenario, rows = trainer._scenario, len(by_expert)
        self._problem = Problem.of(scenario)
        self._view = View(self._config.velocities, scenario)
        self._by_expert = by_expert
        size = self._config.expert_noise * generator.random(rows)
        self._noise = _Noise(size, generator, scenario.joints)
        self._memory: Memory | None = None
        self._step = 0
        self._parts: list[tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]] = []

    def act(self, out: Outcome) -> npt.NDArray[Any]:
        """The actions of a step. Shape (N, n)."""
        config = self._config
        seen = observation(out)
        nominal = np.ascontiguousarray(out.nominal[:, np.array(config.offsets) - 1])
        features = self._view.see(seen, np.full(len(out.q), self._step == 0))
        right, self._memory = self._expert.predict(seen | {"nominal": self._shown(out.nominal)}, self._memory)
        if self._step % config.example_every == 0:
            self._parts.append((features.copy(), self._target_of(right, out.q, nominal, self._view.base)))
        self._step += 1
        moved = right + self._noise.next(self._projected, out.q, right)
        mine = self._view.act(network_outputs(self._model, features))
        follows = self._by_expert | (out.position_error > config.intervention_distance)
        return np.where(follows[:, None], moved, mine)

    def examples(self) -> Examples:
        """What the expert would have done."""
        return Examples(*[torch.from_numpy(np.concatenate(part)) for part in zip(*self._parts, strict=True)])

    def _shown(self, nominal: FloatArray) -> FloatArray:
        """What the expert sees of the nominal coordinates ahead."""
        return np.ascontiguousarray(nominal[:, np.array(offsets(self._expert.preview)) - 1])

    def _target_of(
        self, right: npt.NDArray[np.float32], q: FloatArray, nominal: FloatArray, base: FloatArray | None
    ) -> npt.NDArray[np.float32]:
        """Network outputs for the expert's actions, or for their projection into the null space."""
        processing, problem = self._config.velocities, self._problem
        scratch = np.empty((*nominal.shape[:2], problem.task.error_size))
        speed = speed_rows(problem.task.kind, problem.dt, np.array(processing.offsets), nominal, scratch)
        missing = (right if base is None else right - base) * problem.velocity_limit
        target: npt.NDArray[np.float64] = self._projected(q, missing) / (processing.action_scale * speed[:, None])
        return target.clip(-1.0, 1.0).astype(np.float32)

    def _projected(self, q: FloatArray, velocity: FloatArray) -> FloatArray:
        """Joint velocities as network outputs can make them."""
        out = velocity.astype(np.float64)
        damping = self._config.null_space
        if damping is not None:
            problem = self._problem
            project_rows(problem.model.chain, problem.task.kind, damping, problem.task.error_size, q, out)
        return out


class _Noise:
    """Correlated noise, of another size and correlation time in each row."""

    def __init__(self, size: FloatArray, generator: np.random.Generator, joints: int) -> None:
        self._size, self._generator = size, generator
        self._kept = np.where(np.arange(len(size)) % 2, 0.98, 0.997)[:, None]
        self._value = np.zeros((len(size), joints))

    def next(self, projected: Projector, q: FloatArray, action: npt.NDArray[Any]) -> FloatArray:
        """What is added to actions. Shapes (N, n)."""
        fresh = self._generator.normal(size=self._value.shape)
        self._value = self._kept * self._value + np.sqrt(1.0 - self._kept**2) * fresh
        out: FloatArray = self._size[:, None] * np.abs(action).max(1, keepdims=True) * projected(q, self._value)
        return out
