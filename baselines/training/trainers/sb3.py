"""PPO, SAC and TD3 of Stable-Baselines3, cut into segments."""

from __future__ import annotations

import abc
import contextlib
import copy
from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import ActionNoise, NormalActionNoise, OrnsteinUhlenbeckActionNoise
from stable_baselines3.common.utils import FloatSchedule
from torch import nn

from baselines.training.config.common import PPO, SAC, TD3, OffPolicy, Reinforcement
from baselines.training.environment.vec_env import ProcessedVecEnv
from baselines.training.randomness import episode_seed
from baselines.training.trainer import Metrics
from baselines.training.trainers.initial import begin_from
from baselines.training.trainers.models import new_model
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario

#: What a model counts.
COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")
#: What a replay buffer holds, a row a step.
REPLAYED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


class SB3Trainer(abc.ABC):
    """A model of Stable-Baselines3 that learns segment by segment, see :class:`baselines.training.trainer.Trainer`.

    A segment begins with new episodes and plays all of them to their end, so that no state of an arm outlives it.

    Args:
        config: Of the method.
        scenario: What is to be tracked.
        seed: Of the run.

    Raises:
        UnknownNameError: There is no such policy under the agent.
        InvalidInputError: Numbers do not divide, or `init` does not suit.
        TrainingError: The file of `init` cannot be read.
    """

    def __init__(self, config: Reinforcement, scenario: Scenario, seed: int) -> None:
        self.processing, self.segments = config.processing, config.segments
        self._config, self._seed = config, seed
        self._length, self._joints = config.episodes * scenario.steps, scenario.joints
        self._scenario = scenario
        self._cuts = _cuts(scenario.steps, config.cut)
        self._env = self._new_env(self._cuts[0])
        self._ends = config.envs * self._length // self._cuts[0]
        self.model: Any = self._make()
        if config.init is not None:
            begin_from(self.model, config)
            self._begun()

    @property
    def steps(self) -> int:
        """Steps that arms have been moved by so far."""
        return int(self.model.num_timesteps)

    def segment(self, number: int) -> Metrics:
        """Trains for one segment.

        Args:
            number: Counted from 0.
        """
        model = self.model
        cut = self._cuts[min(2 * len(self._cuts) * number // self.segments, len(self._cuts) - 1)]
        if len(self._cuts) > 1:
            self._env = self._new_env(cut)
            model.set_env(self._env)
        self._env.seed(episode_seed(self._seed, number, self._env.num_envs))
        model._last_obs = None  # makes it reset the environment
        model.ep_info_buffer = None
        model.lr_schedule = FloatSchedule(self._config.learning_rate_of(number))
        model.logger.name_to_value.clear()
        with self._actor_at_rest() if number < self._config.critic_warmup else contextlib.nullcontext():
            self._learn(number)
        metrics = {name: float(value) for name, value in model.logger.name_to_value.items()}
        # Of those that are cut off, what a whole one would cost.
        costs = [-episode["r"] * self._scenario.steps / episode["l"] for episode in model.ep_info_buffer]
        metrics["train/cost"] = float(np.exp(np.mean(np.log(np.maximum(costs, np.finfo(np.float64).tiny)))))
        return metrics

    def state(self) -> dict[str, Any]:
        """See :meth:`baselines.training.trainer.Trainer.state`."""
        _, others = self.model._get_torch_save_params()
        return {
            "parameters": copy.deepcopy(self.model.get_parameters()),
            "others": {name: getattr(self.model, name).detach().clone() for name in others},
            "counters": {name: int(getattr(self.model, name)) for name in COUNTERS},
        }

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`baselines.training.trainer.Trainer.restore`."""
        self.model.set_parameters(state["parameters"], device="cpu")
        for name, tensor in state["others"].items():
            getattr(self.model, name).data.copy_(tensor)
        for name, count in state["counters"].items():
            setattr(self.model, name, count)

    def _new_env(self, cut: int) -> ProcessedVecEnv:
        config = self._config
        # Values are then of the size of rewards: of sums a hundred times as large, the critics would take most of the
        # gradient that is left after it has been clipped.
        scale = max(1.0 - config.gamma, 1e-3)
        return ProcessedVecEnv(config.envs, self._scenario, config.processing, config.reward, scale, cut)

    def _learn(self, number: int) -> None:
        del number
        steps = self._length * self._env.num_envs
        self.model.learn(steps, log_interval=None, reset_num_timesteps=False)

    @abc.abstractmethod
    def _make(self) -> BaseAlgorithm:
        """The untrained model."""

    def _begun(self) -> None:  # noqa: B027  # most have nothing to do then
        """Called when the model has got weights from elsewhere."""

    @abc.abstractmethod
    def _actor(self) -> list[nn.Parameter]:
        """The weights that answers are made with."""

    @contextlib.contextmanager
    def _actor_at_rest(self) -> Iterator[None]:
        """Lets only the critics learn."""
        for parameter in self._actor():
            parameter.requires_grad_(False)
        try:
            yield
        finally:
            for parameter in self._actor():
                parameter.requires_grad_(True)

    def _divides(self, name: str, steps: int) -> int:
        """Insists that a number of steps divides those of a segment, so that the segment is not overrun."""
        if self._length % steps:
            raise InvalidInputError(
                f"{name}: expected a divisor of the {self._length} steps of a segment, got {steps}."
            )
        return steps


class PPOTrainer(SB3Trainer):
    """See :class:`baselines.training.config.common.PPO`."""

    _config: PPO

    def _make(self) -> BaseAlgorithm:
        config = self._config
        rollout = self._divides("rollout", self._length if config.rollout is None else config.rollout)
        if (rollout * config.envs) % config.batch_size:
            raise InvalidInputError(
                f"batch_size: expected a divisor of the {rollout * config.envs} transitions between two updates, got "
                f"{config.batch_size}."
            )
        return new_model(
            "ppo",
            self._env,
            config.hidden,
            config.activation,
            config.log_std_init,
            config.noise_steps,
            learning_rate=config.learning_rate,
            n_steps=rollout,
            batch_size=config.batch_size,
            n_epochs=config.epochs,
            gamma=config.gamma,
            gae_lambda=config.gae_lambda,
            clip_range=config.clip_range,
            target_kl=config.target_kl,
            ent_coef=config.entropy,
            stats_window_size=self._ends,
        )

    def _begun(self) -> None:
        with torch.no_grad():
            self.model.policy.log_std.fill_(self._config.log_std_init)

    def _actor(self) -> list[nn.Parameter]:
        policy: Any = self.model.policy
        return [*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters(), policy.log_std]


class OffPolicyTrainer(SB3Trainer):
    """What SAC and TD3 have in common: a memory of transitions, which is part of the state."""

    _config: OffPolicy

    def state(self) -> dict[str, Any]:
        """See :meth:`baselines.training.trainer.Trainer.state`."""
        buffer = self.model.replay_buffer
        rows = slice(buffer.size())
        replayed = {name: torch.tensor(getattr(buffer, name)[rows]) for name in REPLAYED}
        return {**super().state(), "buffer": {"pos": buffer.pos, "full": buffer.full, **replayed}}

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`baselines.training.trainer.Trainer.restore`."""
        super().restore(state)
        buffer, kept = self.model.replay_buffer, state["buffer"]
        for name in REPLAYED:
            getattr(buffer, name)[: len(kept[name])] = kept[name].numpy()
        buffer.pos, buffer.full = kept["pos"], kept["full"]

    def _learn(self, number: int) -> None:
        collecting = number < self._config.collect
        self.model.gradient_steps = 0 if collecting else self._config.gradient_steps
        super()._learn(number)

    def _parameters(self) -> dict[str, Any]:
        config = self._config
        return {
            "learning_rate": config.learning_rate,
            "buffer_size": config.buffer,
            "learning_starts": 0,  # until then the agent would act at random, and lose its arm
            "batch_size": config.batch_size,
            "tau": config.tau,
            "gamma": config.gamma,
            "train_freq": (self._divides("train_every", config.train_every), "step"),
            "gradient_steps": config.gradient_steps,
            "stats_window_size": self._ends,
        }

    def _actor(self) -> list[nn.Parameter]:
        return list(self.model.policy.actor.parameters())


class SACTrainer(OffPolicyTrainer):
    """See :class:`baselines.training.config.common.SAC`."""

    _config: SAC

    def _make(self) -> BaseAlgorithm:
        config = self._config
        return new_model(
            "sac",
            self._env,
            config.hidden,
            config.activation,
            config.log_std_init,
            config.noise_steps,
            ent_coef=f"auto_{config.temperature!r}",
            target_entropy=config.entropy * self._joints,
            **self._parameters(),
        )

    @contextlib.contextmanager
    def _actor_at_rest(self) -> Iterator[None]:
        """The temperature rests, too: it would run away while the actor cannot follow."""
        model: Any = self.model
        optimizer, model.ent_coef_optimizer = model.ent_coef_optimizer, None
        model.ent_coef_tensor = model.log_ent_coef.detach().exp()
        try:
            with super()._actor_at_rest():
                yield
        finally:
            model.ent_coef_optimizer = optimizer
            del model.ent_coef_tensor


class TD3Trainer(OffPolicyTrainer):
    """See :class:`baselines.training.config.common.TD3`."""

    _config: TD3

    def _make(self) -> BaseAlgorithm:
        config, joints = self._config, self._joints
        return new_model(
            "td3",
            self._env,
            config.hidden,
            config.activation,
            action_noise=_noise(joints, config.noise, config.noise_steps),
            policy_delay=config.policy_delay,
            target_policy_noise=config.target_noise,
            target_noise_clip=2.5 * config.target_noise,
            **self._parameters(),
        )


def _cuts(steps: int, first: int | None) -> list[int]:
    """Lengths of episodes that a segment is a multiple of, from the first one up to the whole."""
    if first is None:
        return [steps]
    if steps % first:
        raise InvalidInputError(f"cut: expected a divisor of the {steps} steps of an episode, got {first}.")
    return [cut for cut in range(first, steps + 1) if steps % cut == 0]


def _noise(joints: int, deviation: float, steps: int) -> ActionNoise:
    """Noise of a standard deviation that forgets itself within some steps."""
    mean = np.zeros(joints)
    if steps == 1:
        return NormalActionNoise(mean, np.full(joints, deviation))
    return OrnsteinUhlenbeckActionNoise(
        mean, np.full(joints, deviation * np.sqrt(2.0 / steps)), theta=1.0 / steps, dt=1.0
    )
