"""PPO, SAC and TD3 of Stable-Baselines3, unmodified, on :func:`ikgym.sb3.make_vec`."""

from __future__ import annotations

import inspect
import io
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import KVWriter, Logger
from stable_baselines3.common.noise import NormalActionNoise

import ikgym.sb3
from baselines.agents.files import AgentFile
from baselines.training.config import Reinforcement
from baselines.training.exporting import exported
from baselines.training.randomness import episode_seed, sequence
from baselines.training.trainers.base import SegmentMetrics, Trainer
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import known_names

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3}
#: Parameters of the algorithms that are no options.
OWN = ("self", "policy", "env", "seed", "device", "verbose", "tensorboard_log", "_init_setup_model")


class SB3Trainer(Trainer):
    """Calls `learn` once a segment. New episodes begin in each, so that a segment depends on the model alone.

    Args:
        config: The options of PPO, SAC or TD3.
        scenario: The scenario to train on.
        seed: The seed of the run.

    Raises:
        UnknownNameError: The algorithm has no such setting.
        InvalidInputError: The algorithm refuses a setting, or agents do not support the observation, such as a history.
    """

    def __init__(self, config: Reinforcement, scenario: Scenario, seed: int) -> None:
        self._config, self._seed, self._log = config, seed, _Log()
        self._kind: Any = ALGORITHMS[config.method]
        self._envs = ikgym.sb3.make_vec(scenario, config.n_envs, **config.learning_settings)
        parameters = [name for name in inspect.signature(self._kind.__init__).parameters if name not in OWN]
        settings = config.algorithm_settings
        known_names(f"setting of {config.method}", settings, parameters)
        if "buffer_size" in parameters:
            settings.setdefault("buffer_size", min(1_000_000, config.total_timesteps))
        if isinstance(noise := settings.get("action_noise"), (int, float)):
            joints = np.ones(scenario.joints)
            settings["action_noise"] = NormalActionNoise(0.0 * joints, noise * joints)
        try:
            model = self._kind("MlpPolicy", self._envs, device="cpu", **settings)
        except (AssertionError, TypeError, ValueError) as e:  # Stable-Baselines3's own checks
            raise InvalidInputError(f"set: {config.method} refuses {', '.join(config.settings)}: {e}") from e
        self._take(model)

    @property
    def steps(self) -> int:  # type: ignore[override]
        """See :class:`Trainer`."""
        return int(self.model.num_timesteps)

    def segment(self, number: int) -> SegmentMetrics:
        """See :meth:`Trainer.segment`."""
        config, model = self._config, self.model
        model.set_env(self._envs, force_reset=True)
        model.set_random_seed(int(sequence(self._seed, number).generate_state(1)[0]))
        self._envs.seed(episode_seed(self._seed, number, config.n_envs))
        target = config.total_timesteps * (number + 1) // config.segments
        self._log.values.clear()
        if model.num_timesteps < target:
            model.learn(target - model.num_timesteps, reset_num_timesteps=False)
            model.logger.dump()  # metrics of the last update, which Stable-Baselines3 keeps for the next rollout
        return {name: float(value) for name, value in self._log.values.items() if isinstance(value, (int, float))}

    def agent(self, training: dict[str, Any] | None = None) -> AgentFile:
        """See :meth:`Trainer.agent`."""
        return exported(self.model, self._envs, training)

    def state(self) -> dict[str, Any]:
        """See :meth:`Trainer.state`."""
        out = {"model": _saved(self.model.save)}
        return out | ({"buffer": _saved(self.model.save_replay_buffer)} if hasattr(self.model, "replay_buffer") else {})

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`Trainer.restore`."""
        self._take(self._kind.load(_stream(state["model"]), env=self._envs, device="cpu"))
        if "buffer" in state:
            self.model.load_replay_buffer(_stream(state["buffer"]))

    def _take(self, model: Any) -> None:
        model.set_logger(Logger(None, [self._log]))
        self.model, self.policy = model, model.policy


class _Log(KVWriter):
    """Keeps the last value of each metric that Stable-Baselines3 logs."""

    def __init__(self) -> None:
        self.values: dict[str, Any] = {}

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, Any], step: int = 0) -> None:
        del key_excluded, step
        self.values |= {name: value for name, value in key_values.items() if not name.startswith("time/")}

    def close(self) -> None:
        """Nothing is open."""


def _saved(save: Any) -> torch.Tensor:
    """The bytes that Stable-Baselines3 writes."""
    stream = io.BytesIO()
    save(stream)
    return torch.frombuffer(bytearray(stream.getvalue()), dtype=torch.uint8)


def _stream(content: torch.Tensor) -> io.BytesIO:
    return io.BytesIO(content.numpy().tobytes())
