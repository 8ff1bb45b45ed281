"""The methods of training by name, and their presets: options in a TOML file, by the names of the configuration."""

from __future__ import annotations

import importlib
import pathlib
from typing import TYPE_CHECKING, Any

from baselines.training.config import APG, PPO, SAC, TD3, Config
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.files import read_user_toml
from ikgym.scenarios import Scenario

if TYPE_CHECKING:  # the command line is read without PyTorch
    from baselines.training.trainers.base import Trainer

#: Configurations by the names of their methods; the docstring of each describes the method on the command line.
METHODS: dict[str, type[Config]] = {kind.method: kind for kind in (PPO, SAC, TD3, APG)}
#: Modules and classes of the trainers, which are called with configuration, scenario and seed.
_TRAINERS = {
    "ppo": ("sb3", "SB3Trainer"),
    "sac": ("sb3", "SB3Trainer"),
    "td3": ("sb3", "SB3Trainer"),
    "apg": ("apg", "APGTrainer"),
}
#: The presets that come with the training: a table for each, with a table for each method.
PRESETS = pathlib.Path(__file__).with_name("presets.toml")


def get(name: str) -> type[Config]:
    """The configuration class of a method.

    Raises:
        UnknownNameError: There is no such method; the message has the nearest name.
    """
    if name not in METHODS:
        raise UnknownNameError("method", name, METHODS)
    return METHODS[name]


def new_trainer(config: Config, scenario: Scenario, seed: int) -> Trainer:
    """The trainer of a configuration, with the scenario to train on and the seed of the run."""
    module, name = _TRAINERS[config.method]
    kind: Any = getattr(importlib.import_module(f"baselines.training.trainers.{module}"), name)
    trainer: Trainer = kind(config, scenario, seed)
    return trainer


def preset_names() -> tuple[str, ...]:
    """The presets that come with the training."""
    return tuple(read_user_toml(PRESETS))


def configure(kind: type[Config], preset: str | None) -> Config:
    """The configuration of a method from a preset.

    Args:
        kind: The class of the configuration.
        preset: One of :func:`preset_names`, or a file ``NAME.toml`` with options; None for the defaults.

    Raises:
        UnknownNameError: There is no such preset, or the method has no such option.
        InvalidInputError: The preset is for another method, the file cannot be read, or a value is refused.
    """
    if preset is None:
        return kind()
    if preset.endswith(".toml"):
        return kind.from_json(read_user_toml(preset))
    tables = read_user_toml(PRESETS)
    if preset not in tables:
        raise UnknownNameError("preset", preset, tables)
    if kind.method not in tables[preset]:
        raise InvalidInputError(f"The preset {preset} is for {', '.join(tables[preset])}, not for {kind.method}.")
    return kind.from_json(tables[preset][kind.method])
