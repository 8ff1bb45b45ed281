"""Settings of the algorithms in the format of rl-zoo3: read from files, checked, and turned into arguments."""

from __future__ import annotations

import ast
import functools
import inspect
import json
import math
import operator
import pathlib
import typing
from collections.abc import Callable, Mapping
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
from ikgym.validation import FloatArray, flag, known_name, known_names, number, shorten, whole_number

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3, "recurrent_ppo": RecurrentPPO}
#: The published settings: a file an algorithm, with an entry an environment.
SETTINGS = pathlib.Path(__file__).parent / "settings"
#: Most bytes of a file of settings, and most values with those of its aliases.
MOST_BYTES, MOST_VALUES = 2**17, 10_000
#: Arguments of the algorithms that are no settings: a run states them, has no use for them, or no text can.
OTHERS = {"self", "policy", "env", "action_noise", "rollout_buffer_class", "replay_buffer_class", "stats_window_size"}
OTHERS |= {"tensorboard_log", "verbose", "seed", "device", "_init_setup_model"}
#: Bounds of numbers, which Stable-Baselines3 takes unchecked; whole numbers without an entry begin at 1.
BOUNDS: dict[str, dict[str, Any]] = {
    **{name: {"at_least": 0.0, "at_most": 1.0} for name in ("gamma", "gae_lambda")},
    "tau": {"above": 0.0, "at_most": 1.0},
    **{name: {"above": 0.0} for name in ("learning_rate", "clip_range", "clip_range_vf", "max_grad_norm", "target_kl")},
    **{name: {"at_least": 0.0} for name in ("ent_coef", "vf_coef", "target_policy_noise", "target_noise_clip")},
    **{name: {"at_least": -1} for name in ("gradient_steps", "sde_sample_freq")},
    "learning_starts": {"at_least": 0},
    "clip_mean": {"above": 0.0},
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
    if not isinstance(entry, dict) or "n_timesteps" not in entry:
        raise InvalidInputError(f"settings: expected n_timesteps and others of {config.env}, got {shorten(entry)}.")
    if not _is_json(entry):  # run.json states them
        raise InvalidInputError(
            f"settings: expected texts, finite numbers, lists and tables by text, got {shorten(entry)}."
        )
    steps = number("n_timesteps", entry["n_timesteps"], at_least=1.0)
    return {**entry, "n_timesteps": int(steps)}


def read_entries(file: pathlib.Path) -> dict[str, Any]:
    """The entries of a file of settings by the ids of their environments.

    Raises:
        InvalidInputError: The file cannot be read.
    """
    text = read_user_file(file, MOST_BYTES)
    try:
        # Aliases may stand for more values than memory has: they are counted before the values are made.
        count = _count(yaml.compose(text, yaml.SafeLoader), {})
        if count <= MOST_VALUES:
            content = yaml.safe_load(text)
    except (AttributeError, LookupError, RecursionError, TypeError, ValueError, yaml.YAMLError) as e:
        raise InvalidInputError(f"settings: expected a YAML file of rl-zoo3, got {file}: {reason(e)}.") from e
    if count > MOST_VALUES:
        raise InvalidInputError(f"settings: expected at most {MOST_VALUES} values with those of aliases, got more.")
    return content if isinstance(content, dict) else {}


def arguments(algorithm: str, settings: Mapping[str, Any], joints: int) -> dict[str, Any]:
    """The arguments of an algorithm for settings, with its `policy`.

    Args:
        algorithm: One of :data:`ALGORITHMS`.
        settings: Values by name, as :func:`read_settings` gives them.
        joints: Number of joints, for the noise of actions.

    Raises:
        UnknownNameError: There is no such setting.
        InvalidInputError: A value is refused: of another type, out of its range, or without effect.
    """
    kind = ALGORITHMS[algorithm]
    hints = _annotations(kind.__init__)
    noisy = "action_noise" in hints
    known = [*(name for name in hints if name not in OTHERS), "policy", *("noise_type", "noise_std") * noisy]
    given = {name: value for name, value in settings.items() if name not in ("n_timesteps", "n_envs")}
    known_names(f"setting of {algorithm}", given, known)
    policy = given.pop("policy", next(iter(kind.policy_aliases)))
    known_name("policy", policy, kind.policy_aliases)
    noise = {name: given.pop(name) for name in ("noise_type", "noise_std") if name in given}
    out = {"policy": policy, **{name: _argument(name, value, hints[name]) for name, value in given.items()}}
    for name in ("sde_sample_freq", "use_sde_at_warmup"):
        if name in out and not out.get("use_sde"):
            raise InvalidInputError(f"{name} has no effect without use_sde.")
    if noise:
        known_name("noise_type", noise.get("noise_type"), ("normal",))
        deviation: FloatArray = np.full(joints, number("noise_std", noise.get("noise_std", math.nan), at_least=0.0))
        out["action_noise"] = NormalActionNoise(np.zeros(joints), deviation)
    if out.get("policy_kwargs"):
        out["policy_kwargs"] = _policy_arguments(kind.policy_aliases[policy], out["policy_kwargs"])
    return out


def _policy_arguments(policy: Any, values: Mapping[str, Any]) -> dict[str, Any]:
    """Checked values of `policy_kwargs`."""
    hints = _annotations(policy.__init__)
    for name in ("self", "observation_space", "action_space", "lr_schedule", "use_sde"):
        hints.pop(name, None)
    known_names("key of policy_kwargs", values, hints)
    if "net_arch" in values:
        _check_layers(values["net_arch"])
    return {
        name: value if name == "net_arch" else _argument(name, value, hints[name]) for name, value in values.items()
    }


def _check_layers(value: Any) -> None:
    """Checks the widths of hidden layers: a list, or one for the policy and others for the critics."""
    tables = value if isinstance(value, dict) else {"pi": value}
    known_names("network in net_arch", tables, ("pi", "vf", "qf"))
    for widths in tables.values():
        if not isinstance(widths, list):
            raise InvalidInputError(f"net_arch: expected lists of the widths of layers, got {shorten(value)}.")
        for width in widths:
            whole_number("net_arch", width, at_least=1)


def _argument(name: str, value: Any, hint: Any) -> Any:
    """A value as rl-zoo3 reads it, checked by the annotation of its argument, and by :data:`BOUNDS`."""
    kinds, bounds = typing.get_args(hint) or (hint,), BOUNDS.get(name, {})
    if value is None and type(None) in kinds:
        return None
    if name == "train_freq" and isinstance(value, list) and len(value) == 2:
        known_name("unit of train_freq", value[1], ("step", "episode"))
        return whole_number(name, value[0], at_least=1), value[1]
    if bool in kinds:
        return flag(name, value)
    if int in kinds:
        if name == "gradient_steps" and value == 0:
            raise InvalidInputError(f"{name}: expected -1 or a whole number of at least 1, got 0.")
        return whole_number(name, value, **(bounds or {"at_least": 1}))
    text = isinstance(value, str)
    if str in kinds and (value == "auto" or (name == "ent_coef" and text and value.startswith("auto_"))):
        if value != "auto":
            _after(name, value, "auto_")
        return value
    if text and any(typing.get_origin(kind) is Callable for kind in kinds):
        return functools.partial(operator.mul, _after(name, value, "lin_"))  # of the share that remains
    if float in kinds:
        return number(name, value, **bounds)
    if any(typing.get_origin(kind) is dict for kind in kinds):
        if text and value.startswith("dict("):
            value = _parse(name, value)
        if not isinstance(value, dict):
            raise InvalidInputError(f"{name}: expected a table, got {shorten(value)}.")
    return value


def _annotations(function: Callable[..., Any]) -> dict[str, Any]:
    """The annotations of a function's parameters by name."""
    return {name: parameter.annotation for name, parameter in inspect.signature(function).parameters.items()}


def _after(name: str, text: str, prefix: str) -> float:
    """The number above 0 behind a prefix."""
    try:
        return number(name, float(text.removeprefix(prefix)) if text.startswith(prefix) else math.nan, above=0.0)
    except (InvalidInputError, ValueError):
        raise InvalidInputError(f"{name}: expected a number, or {prefix} and one above 0, got {text!r}.") from None


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


def _is_json(value: object) -> bool:
    """Whether JSON can state a value."""
    try:
        return bool(json.loads(json.dumps(value, allow_nan=False)) == value)
    except (RecursionError, TypeError, ValueError):
        return False


def _count(node: Any, counts: dict[int, float]) -> float:
    """The number of values in a node of YAML, each alias counted in full; infinite if a node contains itself."""
    if id(node) not in counts:
        counts[id(node)] = math.inf
        values = node.value if isinstance(node, yaml.CollectionNode) else ()
        parts = [part for value in values for part in (value if isinstance(value, tuple) else (value,))]
        counts[id(node)] = 1 + sum(_count(part, counts) for part in parts)
    return counts[id(node)]
