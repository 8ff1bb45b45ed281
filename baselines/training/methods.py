"""The methods of training by name, and the presets of apg: options in a TOML file."""

from __future__ import annotations

import pathlib

from baselines.training.config import APG, PPO, SAC, TD3, RecurrentPPO, Rewards
from ikgym.files import read_user_toml
from ikgym.validation import known_name

#: Configurations by the names of their methods; the docstring of each describes the method on the command line.
BY_REWARDS: dict[str, type[Rewards]] = {kind.method: kind for kind in (PPO, SAC, TD3, RecurrentPPO)}
METHODS: dict[str, type[APG | Rewards]] = {APG.method: APG, **BY_REWARDS}
#: The presets that come with the training, a table each.
PRESETS = pathlib.Path(__file__).with_name("presets.toml")


def preset_names() -> tuple[str, ...]:
    """The presets that come with the training."""
    return tuple(read_user_toml(PRESETS))


def configure(preset: str | None) -> APG:
    """The configuration of a preset.

    Args:
        preset: One of :func:`preset_names`, or a file ``NAME.toml`` with options; None for the defaults.

    Raises:
        UnknownNameError: There is no such preset or option.
        InvalidInputError: The file cannot be read, or a value is refused.
    """
    if preset is None:
        return APG()
    if preset.endswith(".toml"):
        return APG.from_json(read_user_toml(preset))
    known_name("preset", preset, tables := read_user_toml(PRESETS))
    return APG.from_json(tables[preset])
