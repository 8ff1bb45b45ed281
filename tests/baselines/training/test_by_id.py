"""Training of Stable-Baselines3 in the environments by id, with settings in the format of rl-zoo3."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.noise import NormalActionNoise

from baselines.cli.commands.train import main
from baselines.training.by_id import Training
from baselines.training.trainers.sb3 import ALGORITHMS
from ikgym.exceptions import IkgymError
from ikgym.rl import IDS

TRACK = "ikgym/Track-v0"
NET = "dict(net_arch=[8, 8])"
SMALL = {
    "ppo": f'{{n_envs: 2, n_timesteps: 64, policy: MlpPolicy, n_steps: 16, batch_size: 16, policy_kwargs: "{NET}"}}',
    "sac": f'{{n_envs: 2, n_timesteps: 64, learning_starts: 20, batch_size: 8, policy_kwargs: "{NET}"}}',
    "td3": '{n_envs: 2, n_timesteps: 64, learning_starts: 20, batch_size: 8, noise_type: normal, noise_std: 0.1, '
    "policy_kwargs: {net_arch: [8, 8]}}",
}  # fmt: skip


@pytest.fixture
def settings(tmp_path, request):
    file = tmp_path / "small.yml"
    file.write_text(f"{TRACK}: {SMALL[request.param]}\n", encoding="utf-8")
    return file


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_the_published_settings_have_an_entry_for_each_environment(algorithm):
    for env in IDS:
        found = Training(algorithm, env).read()
        assert found["n_timesteps"] > 0
        model = Training(algorithm, env).make(
            {**found, "n_envs": 1, "buffer_size": 10} if algorithm != "ppo" else found
        )
        assert model.gamma == found["gamma"]


def test_settings_are_read_as_rl_zoo3_reads_them():
    kwargs = "dict(net_arch=[8, 8], activation_fn=nn.ReLU, log_std_init=-1.5)"
    settings = {"n_steps": 8, "batch_size": 8, "learning_rate": "lin_0.004", "clip_range": "lin_0.2"}
    model = Training("ppo", TRACK).make({**settings, "policy_kwargs": kwargs})
    assert model.policy_kwargs == {"net_arch": [8, 8], "activation_fn": torch.nn.ReLU, "log_std_init": -1.5}
    assert [model.lr_schedule(left) for left in (1.0, 0.25, 0.0)] == [0.004, 0.001, 0.0]
    assert model.clip_range(0.5) == 0.1


def test_time_ends_a_run_early_and_the_schedule_counts_steps(tmp_path):
    file = tmp_path / "long.yml"
    file.write_text(
        f"{TRACK}: {{n_timesteps: 10000000, n_steps: 16, batch_size: 16, learning_rate: lin_0.001}}\n", encoding="utf-8"
    )
    training = Training("ppo", TRACK, minutes=0.02, settings=file, validations=1, episodes=2)
    about = training.run(tmp_path / "run")
    assert 0 < about["steps"] < 10_000_000
    rate = PPO.load(tmp_path / "run" / "model.zip").policy.optimizer.param_groups[0]["lr"]
    assert 0.0009 < rate <= 0.001


@pytest.mark.parametrize("setting", [
    {"learning_rate": "1e-3"}, {"learning_rate": "lin_fast"}, {"policy_kwargs": "dict(activation_fn=nn.Swish)"},
    {"policy_kwargs": "dict(activation_fn=eval('1'))"}, {"policy_kwargs": "dict(net_arch="},
])  # fmt: skip
def test_other_texts_are_refused(setting):
    with pytest.raises(IkgymError, match=r"settings: expected|There is no activation|Unknown activation"):
        Training("ppo", TRACK).make({"n_steps": 8, "batch_size": 8, **setting})


@pytest.mark.parametrize(("settings", "algorithm"), [(one, one) for one in SMALL], indirect=["settings"])
def test_the_first_updates_are_those_of_plain_calls(settings, algorithm, tmp_path):
    Training(algorithm, TRACK, seed=3, settings=settings, validations=1, episodes=2).run(tmp_path / "run")
    kind = {"ppo": PPO, "sac": SAC, "td3": TD3}[algorithm]
    plain = {
        "ppo": {"n_steps": 16, "batch_size": 16},
        "sac": {"learning_starts": 20, "batch_size": 8},
        "td3": {
            "learning_starts": 20,
            "batch_size": 8,
            "action_noise": NormalActionNoise(np.zeros(7), np.full(7, 0.1)),
        },
    }[algorithm]
    envs = make_vec_env(TRACK, 2, seed=3)  # as rl-zoo3 makes them
    theirs = kind("MlpPolicy", envs, seed=3, device="cpu", policy_kwargs={"net_arch": [8, 8]}, **plain)
    before = {name: value.clone() for name, value in theirs.policy.state_dict().items()}
    theirs.learn(64)
    ours = kind.load(tmp_path / "run" / "model.zip", device="cpu")
    changed = 0
    for name, value in theirs.policy.state_dict().items():
        assert torch.equal(value, ours.policy.state_dict()[name])
        changed += not torch.equal(value, before[name])
    assert changed > 0


@pytest.mark.parametrize("settings", ["ppo"], indirect=True)
def test_the_command_writes_model_curve_and_score(settings, tmp_path, capsys):
    words = ["ppo", "--env", TRACK, "--settings", str(settings), "--seeds", "1", "2", "--validations", "2"]
    assert main([*words, "--episodes", "2", "--out", str(tmp_path / "runs")]) == 0
    assert "seed 2: score" in capsys.readouterr().out
    for seed in (1, 2):
        folder = tmp_path / "runs" / f"seed-{seed}"
        about = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        rows = list(csv.DictReader((folder / "curve.csv").read_text(encoding="utf-8").splitlines()))
        assert about["steps"] == int(rows[-1]["steps"]) == 64
        assert float(rows[-1]["score"]) == pytest.approx(about["validation_score"], abs=1e-4)
        assert (folder / "model.zip").is_file()


@pytest.mark.parametrize("settings", ["td3"], indirect=True)
@pytest.mark.parametrize(("words", "message"), [
    (["ppo", "--env", "ikgym/Trak-v0"], "ikgym/Track-v0"),
    (["pp", "--env", TRACK], "ppo"),
    (["ppo", "--env", "ikgym/Fast-v0", "--settings", "FILE"], "ikgym/Track-v0"),
    (["ppo", "--env", TRACK, "--settings", "FILE"], "ppo refuses"),
    (["ppo", "--env", TRACK, "--settings", "FILE", "--defaults"], "no effect with --defaults"),
    (["ppo", "--env", TRACK, "--settings", "missing.yml"], "expected a YAML file"),
])  # fmt: skip
def test_mistakes_are_named(words, message, settings, tmp_path, capsys):
    words = [str(settings) if word == "FILE" else word for word in words]
    assert main([*words, "--out", str(tmp_path / "runs")]) == 2
    assert message in capsys.readouterr().err


def test_another_kind_of_model_is_not_exported(tmp_path):
    from baselines.training.exporting import export

    model = Training("ppo", TRACK).make({"n_envs": 1, "n_steps": 8, "batch_size": 8})
    with pytest.raises(IkgymError, match="got an environment by id"):
        export(model, model.get_env(), tmp_path / "agent.safetensors")
