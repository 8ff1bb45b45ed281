"""All methods of training, by name."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import NamedTuple

from baselines.training.config.actor_only import APG, Imitate
from baselines.training.config.base import Config
from baselines.training.config.observe import Observe
from baselines.training.config.off_policy import SAC, TD3
from baselines.training.config.ppo import PPO
from baselines.training.trainer import Trainer
from ikgym.exceptions import UnknownNameError
from ikgym.scenarios import Scenario

#: Makes a trainer from its configuration, the scenario and the seed of the run.
Maker = Callable[[Config, Scenario, int], Trainer]


class Method(NamedTuple):
    """A method of training.

    Attributes:
        config: Its configuration, whose docstring says on the command line what the method is.
        maker: Where its trainer is: module and name.
    """

    config: type[Config]
    maker: tuple[str, str]

    def make(self, config: Config, scenario: Scenario, seed: int) -> Trainer:
        """A trainer."""
        module, name = self.maker
        make: Maker = getattr(importlib.import_module(module), name)
        return make(config, scenario, seed)


METHODS: dict[str, Method] = {
    "ppo": Method(PPO, ("baselines.training.trainers.ppo", "PPOTrainer")),
    "sac": Method(SAC, ("baselines.training.trainers.off_policy", "SACTrainer")),
    "td3": Method(TD3, ("baselines.training.trainers.off_policy", "TD3Trainer")),
    "imitate": Method(Imitate, ("baselines.training.trainers.imitate", "ImitateTrainer")),
    "apg": Method(APG, ("baselines.training.trainers.apg", "APGTrainer")),
    "observe": Method(Observe, ("baselines.training.trainers.observe", "ObserveTrainer")),
}


def get(name: str) -> Method:
    """The method of a name.

    Raises:
        UnknownNameError: There is no such method; the message has the nearest name.
    """
    if name not in METHODS:
        raise UnknownNameError("method", name, METHODS)
    return METHODS[name]
