"""Settings of the algorithms in the format of rl-zoo3, turned into arguments.

Names and bounds are checked here. All else is left to Stable-Baselines3, whose errors
:mod:`baselines.training.rewards` passes on.
"""

from __future__ import annotations

import ast
import functools
import inspect
import math
import operator
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise

from baselines.files import reason
from baselines.training.exporting import ACTIVATIONS
from baselines.training.options import Rewards
from ikgym.exceptions import InvalidInputError
from ikgym.files import read_user_file
from ikgym.validation import FloatArray, known_name, known_names, number, shorten

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3, "recurrent_ppo": RecurrentPPO}
#: The published settings: a file an algorithm, with an entry an environment.
SETTINGS = pathlib.Path(__file__).parent / "settings"
#: Most bytes of a file of settings, and the most levels and elements of a list or a table in it.
MOST_BYTES, LEVELS, ELEMENTS = 2**17, 3, 100
#: Arguments of the algorithms that are no settings: a run states them, has no use for them, or no text can.
OTHERS = {"self", "policy", "env", "action_noise", "rollout_buffer_class", "replay_buffer_class", "stats_window_size"}
OTHERS |= {"tensorboard_log", "verbose", "seed", "device", "_init_setup_model"}
#: Bounds of numbers with which the library would train in silence, or for ever.
BOUNDS: dict[str, dict[str, float]] = {
    **{name: {"at_least": 0.0, "at_most": 1.0} for name in ("gamma", "gae_lambda")},
    "tau": {"above": 0.0, "at_most": 1.0},
    **{name: {"above": 0.0} for name in ("learning_rate", "clip_range", "clip_range_vf", "max_grad_norm", "target_kl")},
    **{name: {"at_least": 0.0} for name in ("ent_coef", "vf_coef", "target_policy_noise", "target_noise_clip")},
    **{name: {"at_least": 1.0} for name in ("n_steps", "n_epochs", "batch_size", "buffer_size", "train_freq")},
}


def read_settings(config: Rewards) -> dict[str, Any]:
    """The settings of algorithm and environment, as the file has them.

    Raises:
        UnknownNameError: The file has no entry for the environment.
        InvalidInputError: The file cannot be read.
    """
    if config.defaults:
        return {"n_timesteps": 1_000_000}
    content = read_entries(SETTINGS / f"{config.algorithm}.yml" if config.settings is None else config.settings)
    known_name("environment in the settings", config.env, content)
    entry = content[config.env]
    if not _is_plain(entry, LEVELS):  # run.json states them
        raise InvalidInputError(  # without the entry, which aliases may make longer than memory
            f"settings: expected texts, finite numbers, and lists and tables of these with at most {LEVELS} levels of "
            f"{ELEMENTS} elements, got others in the entry of {config.env}."
        )
    if not isinstance(entry, dict) or "n_timesteps" not in entry:
        raise InvalidInputError(f"settings: expected n_timesteps and others of {config.env}, got {shorten(entry)}.")
    steps = number("n_timesteps", entry["n_timesteps"], at_least=1.0)
    return {**entry, "n_timesteps": int(steps)}


def read_entries(file: pathlib.Path) -> dict[str, Any]:
    """The entries of a file of settings by the ids of their environments.

    Raises:
        InvalidInputError: The file cannot be read.
    """
    text = read_user_file(file, MOST_BYTES)
    try:
        content = yaml.safe_load(text)
    except (AttributeError, LookupError, RecursionError, TypeError, ValueError, yaml.YAMLError) as e:
        raise InvalidInputError(f"settings: expected a YAML file of rl-zoo3, got {file}: {reason(e)}.") from e
    return content if isinstance(content, dict) else {}


def arguments(algorithm: str, settings: Mapping[str, Any], joints: int) -> dict[str, Any]:
    """The arguments of an algorithm for settings, with its `policy`.

    Args:
        algorithm: One of :data:`ALGORITHMS`.
        settings: Values by name, as :func:`read_settings` gives them.
        joints: Number of joints, for the noise of actions.

    Raises:
        UnknownNameError: There is no such setting.
        InvalidInputError: A text or the noise is refused, or a number is out of its range.
    """
    kind = ALGORITHMS[algorithm]
    names = inspect.signature(kind.__init__).parameters
    noisy = "action_noise" in names
    known = [*(name for name in names if name not in OTHERS), "policy", *("noise_type", "noise_std") * noisy]
    given = {name: value for name, value in settings.items() if name not in ("n_timesteps", "n_envs")}
    known_names(f"setting of {algorithm}", given, known)
    policy = given.pop("policy", next(iter(kind.policy_aliases)))
    known_name("policy", policy, kind.policy_aliases)
    noise = {name: given.pop(name) for name in ("noise_type", "noise_std") if name in given}
    out = {"policy": policy, **{name: _argument(name, value) for name, value in given.items()}}
    if noise:
        known_name("noise_type", noise.get("noise_type"), ("normal",))
        deviation: FloatArray = np.full(joints, number("noise_std", noise.get("noise_std", math.nan), at_least=0.0))
        out["action_noise"] = NormalActionNoise(np.zeros(joints), deviation)
    return out


def _argument(name: str, value: Any) -> Any:
    """A value as rl-zoo3 reads it: ``lin_X`` falls from X to 0, a list is a pair, and ``dict(…)`` is a table."""
    first = value[0] if name == "train_freq" and isinstance(value, list) and value else value
    if name in BOUNDS and isinstance(first, int | float):
        number(name, first, **BOUNDS[name])
    if isinstance(value, str) and value.startswith("lin_"):
        try:
            highest = number(name, float(value.removeprefix("lin_")), above=0.0)
        except (InvalidInputError, ValueError):
            raise InvalidInputError(f"{name}: expected lin_ and a number above 0, got {value!r}.") from None
        return functools.partial(operator.mul, highest)  # of the share that remains
    if isinstance(value, str) and value.startswith("dict("):
        return _parse(name, value)
    return tuple(value) if isinstance(value, list) else value


def _parse(name: str, text: str) -> Any:
    """The table in Python's ``dict(…)``."""
    try:
        return _literal(ast.parse(text, mode="eval").body)
    except (MemoryError, RecursionError, SyntaxError, ValueError) as e:  # of text that nests too deeply
        raise InvalidInputError(
            f"settings: expected {name} in the format of rl-zoo3, got {shorten(text)}: {reason(e)}."
        ) from e


def _literal(node: ast.expr) -> Any:
    """A literal, an activation such as ``nn.ReLU``, or a ``dict(…)`` of such values."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "dict" and not node.args:
        return {keyword.arg: _literal(keyword.value) for keyword in node.keywords}
    if isinstance(node, ast.Attribute):
        kinds = {kind.__name__: kind for kind in ACTIVATIONS.values()}
        known_name("activation", node.attr, kinds)
        return kinds[node.attr]
    return ast.literal_eval(node)


def _is_plain(value: object, levels: int) -> bool:
    """Whether a value consists of texts, finite numbers, and lists and tables of these with so many levels.

    Aliases of YAML may stand for more values than memory has.
    """
    if isinstance(value, dict | list):
        parts = value.values() if isinstance(value, dict) else value
        texts = isinstance(value, list) or all(isinstance(name, str) for name in value)
        return texts and len(value) <= ELEMENTS and levels > 0 and all(_is_plain(part, levels - 1) for part in parts)
    return value is None or isinstance(value, str | int) or (isinstance(value, float) and math.isfinite(value))
