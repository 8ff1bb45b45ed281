"""Configurations say what a run is, and refuse what makes none."""

from __future__ import annotations

import json

import pytest

from baselines.training import presets
from baselines.training.config.actor_only import APG
from baselines.training.config.base import Config, JointVelocities, differences
from baselines.training.config.observe import Observe
from baselines.training.config.off_policy import SAC, TD3
from baselines.training.config.ppo import PPO
from baselines.training.methods import METHODS, get
from ikgym.exceptions import InvalidInputError, UnknownNameError

KINDS = [method.config for method in METHODS.values()]


@pytest.mark.parametrize("kind", KINDS, ids=METHODS)
def test_json_holds_all_of_it(kind):
    over = {"base_policy": "dls"} if issubclass(kind, JointVelocities) else {}
    shown = {} if kind is Observe else {"offsets": (1, 5)}
    config = kind(hidden=(3, 4), **shown, **over)
    values = json.loads(json.dumps(config.to_json()))
    assert kind.from_json(values) == config
    assert differences(values, config.to_json()) == []


@pytest.mark.parametrize(
    ("kind", "values", "error", "message"),
    [
        (PPO, {"n_epoch": 3}, UnknownNameError, "no option of ppo 'n_epoch'. Did you mean 'n_epochs'"),
        (SAC, {"n_epochs": 3}, UnknownNameError, "no option of sac 'n_epochs'"),
        (PPO, {"activation": "sili"}, UnknownNameError, "Did you mean 'silu'"),
        (TD3, {"reward": "lg"}, UnknownNameError, "no reward 'lg'"),
        (PPO, {"hidden": []}, InvalidInputError, "hidden: expected at least one"),
        (PPO, {"hidden": 64}, InvalidInputError, "hidden: expected whole numbers, got 64"),
        (PPO, {"hidden": [8, 0]}, InvalidInputError, "hidden: expected a whole number of at least 1, got 0"),
        (PPO, {"offsets": [2, 1]}, InvalidInputError, "offsets: expected"),
        (PPO, {"action_scale": 0}, InvalidInputError, "action_scale: expected"),
        (PPO, {"segments": 0}, InvalidInputError, "segments: expected"),
        (PPO, {"steps": 0}, InvalidInputError, "steps: expected"),
        (PPO, {"keep_best": "yes"}, InvalidInputError, "keep_best: expected true or false"),
        (PPO, {"gamma": 1.5}, InvalidInputError, "gamma: expected a number above 0, at most 1"),
        (PPO, {"learning_rate": -1}, InvalidInputError, "learning_rate: expected a finite number above 0"),
        (PPO, {"learning_rate": 1e300}, InvalidInputError, r"learning_rate: expected a number from 0 to 1e\+30"),
        (PPO, {"target_kl": 0}, InvalidInputError, "target_kl"),
        (SAC, {"ent_coef": "auto_0"}, InvalidInputError, "ent_coef: expected auto, auto_X or a number"),
        (
            SAC,
            {"buffer_size": 3},
            InvalidInputError,
            "buffer_size: expected at least one .* of each arm, got 3",
        ),
        (TD3, {"action_noise": -0.1}, InvalidInputError, "action_noise"),
        (PPO, {"output": "bilinar"}, UnknownNameError, "Did you mean 'bilinear'"),
        (PPO, {"output": "bilinear", "base_policy": "dls"}, InvalidInputError, "base_policy: expected None"),
        (PPO, {"damping": 1e-3}, InvalidInputError, "damping: expected None for an output that is velocities"),
        (PPO, {"output": "bilinear", "lost_distance": 0.0}, InvalidInputError, "lost_distance"),
        (PPO, {"output": "inverse"}, InvalidInputError, "damping: expected a number"),
        (TD3, {"output": "inverse", "damping": 1e-2, "hold": 0}, InvalidInputError, "hold"),
        (TD3, {"output": "inverse", "damping": 1e-2, "log_above": 0.0}, InvalidInputError, "log_above"),
        (SAC, {"output": "inverse", "damping": 1e-2, "privileged": 1}, InvalidInputError, "privileged"),
        (PPO, {"output": "bilinear", "privileged": True}, InvalidInputError, "privileged"),
        (PPO, {"null_noise": 0.2}, InvalidInputError, "null_noise"),
        (TD3, {"output": "inverse", "damping": 1e-2, "null_noise": 0.0}, InvalidInputError, "null_noise"),
        (PPO, {"group_size": 2}, InvalidInputError, "group_size: expected 1 for an output that is velocities, got 2"),
        (PPO, {"group_size": 3, "n_envs": 4}, InvalidInputError, "n_envs: expected a multiple of group_size, 3, got 4"),
        (PPO, {"null_space_noise": True}, InvalidInputError, "null_space_noise: expected False"),
        (PPO, {"null_space_noise": 1}, InvalidInputError, "null_space_noise: expected true or false"),
        (
            PPO,
            {"output": "inverse", "damping": 1e-2, "null_space_noise": True, "use_sde": True},
            InvalidInputError,
            "null_space_noise: expected false with use_sde",
        ),
        (PPO, {"critic_group_weight": 1.0}, InvalidInputError, "critic_group_weight: expected 0 without"),
        (PPO, {"critic_epochs": -1}, InvalidInputError, "critic_epochs"),
        (PPO, {"critic_learning_rate": 0.0}, InvalidInputError, "critic_learning_rate"),
        (APG, {"matrix": False}, InvalidInputError, "damping: expected a number where the network gives no matrix"),
        (APG, {"matrix": "no"}, InvalidInputError, "matrix: expected true or false"),
        (PPO, {"log_std_end": 3.0}, InvalidInputError, "log_std_end"),
    ],
)
def test_refused(kind, values, error, message):
    with pytest.raises(error, match=message):
        kind.from_json(values)


def test_learning_rate_falls_by_equal_factors():
    config = PPO(segments=3, learning_rate=1e-2, learning_rate_end=1e-4)
    assert [config.learning_rate_of(n) for n in range(3)] == pytest.approx([1e-2, 1e-3, 1e-4], rel=1e-12)
    assert PPO(segments=1, learning_rate=1e-2, learning_rate_end=1e-4).learning_rate_of(0) == 1e-2


def test_scenario_is_cut():
    assert PPO(steps=50).make_scenario().steps == 50
    assert PPO(steps=5000).make_scenario().steps == 1000
    with pytest.raises(UnknownNameError, match="Did you mean 'varga7-random'"):
        PPO(scenario="varga7-rand").make_scenario()


def test_differences_are_named():
    there, here = {"a": 1, "b": 2, "c": None}, {"a": 1, "b": 3, "d": 4}
    assert differences(there, here) == ["b (2 there, 3 here)", "c (None there, None here)", "d (None there, 4 here)"]


def test_methods():
    with pytest.raises(UnknownNameError, match=r"no method 'pp'\. Did you mean 'ppo'"):
        get("pp")
    assert all(method.config.method == name and method.config.__doc__ for name, method in METHODS.items())


@pytest.mark.parametrize("name", presets.names())
def test_presets_that_come_along(name):
    """Each suits its method, or all of them."""
    meant = presets.methods_of(presets.read(name))
    for kind in KINDS:
        if kind.method in (meant or METHODS):
            config, given = presets.configure(kind, name)
            assert isinstance(config, Config)
            assert given
            config.make_scenario()


def test_preset_files(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('method = "ppo"\nhidden = [5]\nn_epochs = 2\n')
    config, given = presets.configure(PPO, str(file))
    assert (config, given) == (PPO(hidden=(5,), n_epochs=2), {"hidden", "n_epochs"})
    with pytest.raises(InvalidInputError, match="is for ppo, not for sac"):
        presets.configure(SAC, str(file))
    file.write_text("[ppo]\nn_epochs = 3\n[imitate]\nexpert = 'agent:path=a.zip,trust=True'\n")
    with pytest.raises(InvalidInputError, match=r"The preset .*mine.toml: expert: .*trust"):
        presets.configure(PPO, str(file))
    file.write_text("[ppo]\nn_epochs = 3\n[sac]\ntau = 0.5\n")
    assert presets.configure(PPO, str(file)) == (PPO(n_epochs=3), {"n_epochs"})
    assert presets.configure(SAC, str(file)) == (SAC(tau=0.5), {"tau"})
    with pytest.raises(InvalidInputError, match="is for ppo, sac, not for td3"):
        presets.configure(TD3, str(file))
    file.write_text("n_epoch = 2\n")
    with pytest.raises(UnknownNameError, match=r"no option of ppo 'n_epoch'\. Did you mean 'n_epochs'"):
        presets.configure(PPO, str(file))
    file.write_text("n_epochs = \n")
    with pytest.raises(InvalidInputError, match="is no TOML"):
        presets.configure(PPO, str(file))
    with pytest.raises(InvalidInputError, match="Cannot read the preset"):
        presets.configure(PPO, str(tmp_path / "none.toml"))
    with pytest.raises(UnknownNameError, match=r"no preset 'smok'\. Did you mean 'smoke'"):
        presets.configure(PPO, "smok")
    assert presets.configure(PPO, None) == (PPO(), frozenset())
