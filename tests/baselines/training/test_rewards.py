"""Training of Stable-Baselines3 and sb3-contrib in the environments by id, with settings in the format of rl-zoo3."""

from __future__ import annotations

import csv
import errno
import inspect
import json
import tempfile

import numpy as np
import pytest
import torch
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.noise import NormalActionNoise

import baselines
from baselines.cli.commands.train import main
from baselines.files import locked
from baselines.training.options import Rewards
from baselines.training.rewards import make, train
from baselines.training.zoo import ALGORITHMS, OTHERS, arguments, read_settings
from ikgym import files, rl
from ikgym.exceptions import IkgymError
from ikgym.sb3 import make_vec

TRACK = "ikgym/Track-v0"
NET = "dict(net_arch=[8, 8])"
ONLY = {"recurrent_ppo": ("ikgym/Camera-v0", "ikgym/Payload-v0")}
SMALL = {
    "ppo": f'{{n_envs: 2, n_timesteps: 64, policy: MlpPolicy, n_steps: 16, batch_size: 16, policy_kwargs: "{NET}"}}',
    "sac": f'{{n_envs: 2, n_timesteps: 64, learning_starts: 20, batch_size: 8, policy_kwargs: "{NET}"}}',
    "td3": '{n_envs: 2, n_timesteps: 64, learning_starts: 20, batch_size: 8, noise_type: normal, noise_std: 0.1, '
    "policy_kwargs: {net_arch: [8, 8]}}",
    "recurrent_ppo": "{n_envs: 2, n_timesteps: 64, policy: MlpLstmPolicy, n_steps: 16, batch_size: 16, "
    "policy_kwargs: {net_arch: [8, 8], lstm_hidden_size: 8}}",
}  # fmt: skip


@pytest.fixture
def settings(tmp_path, request):
    file = tmp_path / "small.yml"
    file.write_text(f"{TRACK}: {SMALL[request.param]}\n", encoding="utf-8")
    return file


def options(algorithm, **changes):
    return Rewards(algorithm=algorithm, **{"env": TRACK, "validations": 1, "episodes": 2, **changes})


def model_of(algorithm, settings, env=TRACK):
    return make(algorithm, make_vec(env, settings.get("n_envs", 1)), settings)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_the_published_settings_have_an_entry_for_each_environment(algorithm):
    small = {"n_envs": 1, "buffer_size": 10} if algorithm in ("sac", "td3") else {}
    for env in ONLY.get(algorithm, rl.IDS):
        config = options(algorithm, env=env)
        found = read_settings(config)
        assert found["n_timesteps"] > 0
        assert model_of(algorithm, {**found, **small}, env).gamma == found["gamma"]


def test_settings_are_read_as_rl_zoo3_reads_them():
    kwargs = "dict(net_arch=dict(pi=[8], vf=[9]), activation_fn=nn.ReLU, log_std_init=-1.5)"
    settings = {"n_steps": 8, "batch_size": 8, "learning_rate": "lin_0.004", "clip_range": "lin_0.2"}
    model = model_of("ppo", {**settings, "policy_kwargs": kwargs})
    assert model.policy_kwargs == {
        "net_arch": {"pi": [8], "vf": [9]},
        "activation_fn": torch.nn.ReLU,
        "log_std_init": -1.5,
    }
    assert [model.lr_schedule(left) for left in (1.0, 0.25, 0.0)] == [0.004, 0.001, 0.0]
    assert model.clip_range(0.5) == 0.1


def test_time_ends_a_run_early_and_the_schedule_counts_steps(tmp_path):
    file = tmp_path / "long.yml"
    entry = "{n_timesteps: 10000000, n_steps: 16, batch_size: 16, learning_rate: lin_0.001}"
    file.write_text(f"{TRACK}: {entry}\n", encoding="utf-8")
    about = train(options("ppo", minutes=0.002, settings=file), 0, tmp_path / "run")
    assert 0 < about["steps"] < 10_000_000
    rate = PPO.load(tmp_path / "run" / "model.zip").policy.optimizer.param_groups[0]["lr"]
    assert 0.0009 < rate <= 0.001


@pytest.mark.parametrize("setting", [
    {"learning_rate": "1e-3"},
    {"learning_rate": "lin_fast"},
    {"policy_kwargs": "dict(activation_fn=nn.Swish)"},
    {"policy_kwargs": "dict(activation_fn=eval('1'))"},
    {"policy_kwargs": "dict(net_arch="},
    {"policy_kwargs": "dict([8])"},
    {"policy_kwargs": "dict(a=1).pop('a')"},
])  # fmt: skip
def test_other_texts_are_refused(setting):
    with pytest.raises(IkgymError, match=r"expected a number, or lin_|settings: expected|There is no activation"):
        model_of("ppo", {"n_steps": 8, "batch_size": 8, **setting})


@pytest.mark.parametrize(("settings", "algorithm"), [(one, one) for one in SMALL], indirect=["settings"])
def test_the_first_updates_are_those_of_plain_calls(settings, algorithm, tmp_path):
    train(options(algorithm, settings=settings), 3, tmp_path / "run")
    kind = {"ppo": PPO, "sac": SAC, "td3": TD3, "recurrent_ppo": RecurrentPPO}[algorithm]
    policy, lstm = ("MlpLstmPolicy", {"lstm_hidden_size": 8}) if algorithm == "recurrent_ppo" else ("MlpPolicy", {})
    plain = {
        "ppo": {"n_steps": 16, "batch_size": 16},
        "recurrent_ppo": {"n_steps": 16, "batch_size": 16},
        "sac": {"learning_starts": 20, "batch_size": 8},
        "td3": {
            "learning_starts": 20,
            "batch_size": 8,
            "action_noise": NormalActionNoise(np.zeros(7), np.full(7, 0.1)),
        },
    }[algorithm]
    envs = make_vec_env(TRACK, 2, seed=3)  # as rl-zoo3 makes them
    theirs = kind(policy, envs, seed=3, device="cpu", policy_kwargs={"net_arch": [8, 8], **lstm}, **plain)
    before = {name: value.clone() for name, value in theirs.policy.state_dict().items()}
    theirs.learn(64)
    ours = kind.load(tmp_path / "run" / "model.zip", device="cpu")
    changed = 0
    for name, value in theirs.policy.state_dict().items():
        assert torch.equal(value, ours.policy.state_dict()[name])
        changed += not torch.equal(value, before[name])
    assert changed > 0


@pytest.mark.parametrize("settings", ["ppo"], indirect=True)
def test_the_command_writes_model_agent_curve_and_score_and_goes_on_where_it_was_stopped(settings, tmp_path, capsys):
    words = ["ppo", "--env", TRACK, "--settings", str(settings), "--validations", "2", "--episodes", "2"]
    words += ["--out", str(tmp_path / "runs"), "--seeds"]
    assert main([*words, "1"]) == 0
    assert main([*words, "1", "2"]) == 0
    one, *_, again, two, _, _ = capsys.readouterr().out.splitlines()
    assert again == f"{one}, already there"
    assert two.startswith("seed 2: score ")
    assert not two.endswith("there")
    for seed in (1, 2):
        folder = tmp_path / "runs" / f"seed-{seed}"
        about = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        rows = list(csv.DictReader((folder / "curve.csv").read_text(encoding="utf-8").splitlines()))
        assert about["steps"] == int(rows[-1]["steps"]) == 64
        assert float(rows[-1]["score"]) == pytest.approx(about["validation_score"], abs=1e-4)
        assert (folder / "model.zip").is_file()
        policy = baselines.make("agent", "learning-track", path=folder / "agent.safetensors")
        assert policy.hash == about["agent"][:12]
    assert main([*words, "1", "--total-timesteps", "32"]) == 2
    assert "run.json differs in settings" in capsys.readouterr().err


@pytest.mark.parametrize("settings", ["sac"], indirect=True)
def test_learners_may_see_the_inverse(settings, tmp_path):
    about = train(options("sac", settings=settings, inverse=True, episodes=2), 0, tmp_path / "run")
    model = SAC.load(tmp_path / "run" / "model.zip", device="cpu")
    assert model.observation_space.shape == (38 + 2 * 7,)
    score = rl.score({TRACK: [rl.costs(model, TRACK, episodes=2, inverse=True)]})[TRACK].mean
    assert score == about["validation_score"]
    assert "agents see no history, no inverse" in about["agent"]


@pytest.mark.parametrize("settings", ["recurrent_ppo"], indirect=True)
def test_models_with_memory_play_with_it_and_have_no_agent(settings, tmp_path):
    about = train(options("recurrent_ppo", settings=settings), 0, tmp_path / "run")
    assert about["agent"] == "none: model: expected one without memory, as agents in files are, got an LSTM."
    assert not (tmp_path / "run" / "agent.safetensors").exists()
    model = RecurrentPPO.load(tmp_path / "run" / "model.zip", device="cpu")

    class Forgetful:
        def predict(self, observation, state=None, episode_start=None, deterministic=False):
            return model.predict(observation, deterministic=deterministic)

    one, other = (rl.costs(player, TRACK, episodes=2) for player in (model, Forgetful()))
    assert rl.score({TRACK: [one]})[TRACK].mean == about["validation_score"]
    assert (one != other).all()


def test_the_defaults_of_the_library_are_those_of_its_policy_with_memory():
    model = model_of("recurrent_ppo", {"n_timesteps": 64})
    assert (model.n_envs, model.n_steps, model.policy.lstm_hidden_state_shape) == (1, 128, (1, 1, 256))


@pytest.mark.parametrize("settings", ["td3"], indirect=True)
@pytest.mark.parametrize(("words", "message"), [
    (["ppo", "--env", "ikgym/Trak-v0"], "ikgym/Track-v0"),
    (["pp", "--env", TRACK], "Did you mean 'ppo'"),
    (["ppo"], "expected --env, one of ikgym/Reach-v0, ikgym/Track-v0,"),
    (["ppo", "--env", "ikgym/Fast-v0", "--settings", "FILE"], "ikgym/Track-v0"),
    (["ppo", "--env", TRACK, "--settings", "FILE"], "There is no setting 'learning_starts' of ppo. Did you mean"),
    (["ppo", "--env", TRACK, "--settings", "FILE", "--defaults"], "no effect with --defaults"),
    (["ppo", "--env", TRACK, "--settings", "missing.yml"], "Cannot read missing.yml"),
    (["ppo", "--env", TRACK, "--minutes", "0"], "minutes: expected a finite number above 0"),
    (["ppo", "--env", TRACK, "--episodes", "0"], "episodes: expected a whole number from 1 to 256, got 0"),
])  # fmt: skip
def test_mistakes_are_named(words, message, settings, tmp_path, capsys):
    words = [str(settings) if word == "FILE" else word for word in words]
    assert main([*words, "--out", str(tmp_path / "runs")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize(("content", "message"), [
    ("[", "expected a YAML file"), ("1", "in the settings"), (f"{TRACK}: 3", "expected n_timesteps"),
    (f"{TRACK}: {{gamma: 0.9}}", "expected n_timesteps"),
    (f"{TRACK}: {{n_timesteps: .inf}}", "expected texts, finite numbers"),
    (f"{TRACK}: {{n_timesteps: 0}}", "n_timesteps: expected a finite number of at least 1"),
    (f"{TRACK}: {{n_timesteps: 64, gamma: 2020-01-01}}", "expected texts, finite numbers"),
    (f"{TRACK}: {{n_timesteps: 64, 1: 2}}", "expected texts, finite numbers"),
    (f"{TRACK}: !!bool 3", "expected a YAML file"),
    ("[" * 50_000, "expected a YAML file"),
    (f"{TRACK}: {'x' * 10_000_000}", "expected at most 131072 bytes"),
    ("a0: &a0 [x]\n" + "".join(f"a{n + 1}: &a{n + 1} [{', '.join([f'*a{n}'] * 10)}]\n" for n in range(30)),
     "expected at most 10000 values"),
    (f"{TRACK}: &a {{n_timesteps: 64, policy_kwargs: *a}}", "expected at most 10000 values"),
])  # fmt: skip
def test_other_files_of_settings_are_refused(content, message, tmp_path):
    (tmp_path / "mine.yml").write_text(content, encoding="utf-8")
    with pytest.raises(IkgymError, match=message):
        read_settings(options("ppo", settings=tmp_path / "mine.yml"))


@pytest.mark.parametrize(("algorithm", "setting", "message"), [
    ("ppo", {"gamma": -1}, "gamma: expected a finite number from 0 to 1, got -1.0."),
    ("ppo", {"clip_range": -1}, "clip_range: expected a finite number above 0, got -1.0."),
    ("ppo", {"clip_range": "lin_-1"}, "clip_range: expected a number, or lin_ and one above 0, got 'lin_-1'."),
    ("ppo", {"clip_range": [1]}, r"clip_range: expected a finite number above 0, got \[1\]."),
    ("ppo", {"n_epochs": "few"}, "n_epochs: expected a whole number of at least 1, got 'few'."),
    ("ppo", {"n_steps": 1.5}, "n_steps: expected a whole number of at least 1, got 1.5."),
    ("ppo", {"ent_coef": []}, "ent_coef: expected a finite number of at least 0"),
    ("ppo", {"ent_coef": -0.1}, "ent_coef: expected a finite number of at least 0, got -0.1."),
    ("ppo", {"ent_coef": "auto"}, "ent_coef: expected a finite number of at least 0, got 'auto'."),
    ("ppo", {"target_kl": 0}, "target_kl: expected a finite number above 0, got 0.0."),
    ("ppo", {"vf_coef": -1}, "vf_coef: expected a finite number of at least 0, got -1.0."),
    ("ppo", {"max_grad_norm": 0}, "max_grad_norm: expected a finite number above 0, got 0.0."),
    ("ppo", {"use_sde": "yes"}, "use_sde: expected true or false, got 'yes'."),
    ("ppo", {"normalize_advantage": 1}, "normalize_advantage: expected true or false, got 1."),
    ("ppo", {"sde_sample_freq": 4}, "sde_sample_freq has no effect without use_sde."),
    ("ppo", {"tensorboard_log": "logs"}, "no setting 'tensorboard_log' of ppo. Available: learning_rate, "),
    ("ppo", {"device": "cuda"}, "no setting 'device' of ppo"),
    ("ppo", {"normalize": True}, "no setting 'normalize' of ppo. Did you mean 'normalize_advantage'"),
    ("ppo", {"noise_type": "normal", "noise_std": 0.1}, "no setting 'noise_type' of ppo"),
    ("ppo", {"policy": "MlpPolic"}, "no policy 'MlpPolic'. Did you mean 'MlpPolicy'"),
    ("ppo", {"policy_kwargs": [[[[1]]]]}, "policy_kwargs: expected a table, got"),
    ("ppo", {"policy_kwargs": {"net_arc": [8]}}, "no key 'net_arc' of policy_kwargs. Did you mean 'net_arch'"),
    ("ppo", {"policy_kwargs": {"net_arch": [8, 0]}}, "net_arch: expected a whole number of at least 1, got 0."),
    ("ppo", {"policy_kwargs": {"net_arch": {"critic": [8]}}}, "no network 'critic' in net_arch. Available: pi, vf, qf"),
    ("ppo", {"policy_kwargs": {"ortho_init": "no"}}, "ortho_init: expected true or false, got 'no'."),
    ("ppo", {"policy_kwargs": {"activation_fn": "nn.ReLU"}}, "settings: ppo refuses"),
    ("sac", {"ent_coef": "auto_-1"}, "ent_coef: expected a number, or auto_ and one above 0, got 'auto_-1'."),
    ("sac", {"ent_coef": "low"}, "ent_coef: expected a finite number of at least 0, got 'low'."),
    ("sac", {"target_entropy": "high"}, "target_entropy: expected a finite number, got 'high'."),
    ("sac", {"tau": 0}, "tau: expected a finite number above 0 and of at most 1, got 0.0."),
    ("sac", {"gradient_steps": 0}, "gradient_steps: expected -1 or a whole number of at least 1, got 0."),
    ("sac", {"train_freq": [1, "day"]}, "no unit 'day' of train_freq. Available: step, episode"),
    ("sac", {"train_freq": 0}, "train_freq: expected a whole number of at least 1, got 0."),
    ("sac", {"learning_starts": -1}, "learning_starts: expected a whole number of at least 0, got -1."),
    ("sac", {"buffer_size": "1e5"}, "buffer_size: expected a whole number of at least 1, got '1e5'."),
    ("sac", {"replay_buffer_kwargs": 3}, "replay_buffer_kwargs: expected a table, got 3."),
    ("td3", {"target_policy_noise": -0.1}, "target_policy_noise: expected a finite number of at least 0, got -0.1."),
    ("td3", {"noise_type": "ornstein-uhlenbeck"}, "no noise_type 'ornstein-uhlenbeck'. Available: normal"),
    ("td3", {"noise_std": 0.1}, "There is no noise_type None. Available: normal"),
    ("td3", {"noise_type": "normal", "noise_std": -1}, "noise_std: expected a finite number of at least 0, got -1.0."),
])  # fmt: skip
def test_settings_that_mean_nothing_are_refused_before_the_training(algorithm, setting, message):
    with pytest.raises(IkgymError, match=message):
        model_of(algorithm, setting)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_the_defaults_of_an_algorithm_are_settings(algorithm):
    """So that each of its parameters passes its check, and none is forgotten."""
    kind = ALGORITHMS[algorithm]
    defaults = {name: one.default for name, one in inspect.signature(kind).parameters.items() if name not in OTHERS}
    of_noise = {"sde_sample_freq", "use_sde_at_warmup"}
    expected = {name: value for name, value in defaults.items() if name not in of_noise}
    assert len(expected) > 10
    assert arguments(algorithm, expected, 7).items() >= expected.items()
    sde = {name: value for name, value in defaults.items() if name in of_noise}
    if sde:
        assert arguments(algorithm, {**sde, "use_sde": True}, 7).items() >= sde.items()


@pytest.mark.parametrize("settings", ["ppo"], indirect=True)
def test_errors_of_the_library_are_one_line(settings, tmp_path, capsys):
    text = settings.read_text(encoding="utf-8").replace("n_steps: 16", "n_steps: 16, batch_size: 1")
    settings.write_text(text.replace(", batch_size: 16", ""), encoding="utf-8")
    words = ["ppo", "--env", TRACK, "--settings", str(settings), "--episodes", "2", "--out", str(tmp_path / "runs")]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert "settings: ppo refuses" in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize("settings", ["ppo"], indirect=True)
def test_a_full_disk_ends_a_run_with_a_message_and_the_command_begins_it_again(settings, tmp_path, capsys, monkeypatch):
    write = files.write

    def write_if_there_is_space(file, content):
        if file.name == "model.zip":
            raise OSError(errno.ENOSPC, "No space left on device")
        write(file, content)

    words = ["ppo", "--env", TRACK, "--settings", str(settings), "--episodes", "2", "--out", str(tmp_path)]
    with monkeypatch.context() as patched:
        patched.setattr(files, "write", write_if_there_is_space)
        assert main(words) == 2
    file = tmp_path / "seed-0" / "model.zip"
    assert capsys.readouterr().err == f"error: Cannot write {file}: No space left on device.\n"
    assert not (tmp_path / "seed-0" / "run.json").exists()
    assert main(words) == 0


@pytest.mark.parametrize("settings", ["ppo"], indirect=True)
def test_a_folder_that_is_in_use_or_cannot_be_written_is_refused_before_the_training(settings, tmp_path, capsys):
    words = ["ppo", "--env", TRACK, "--settings", str(settings), "--seeds", "0", "1", "--out"]
    with locked(tmp_path / "runs" / "seed-1"):
        assert main([*words, str(tmp_path / "runs")]) == 2
    assert "seed-1 is in use: process" in capsys.readouterr().err
    assert not list((tmp_path / "runs").rglob("*.csv"))
    (tmp_path / "file").touch()
    assert main([*words, str(tmp_path / "file")]) == 2
    assert capsys.readouterr().err == f"error: Cannot write into {tmp_path / 'file' / 'seed-0'}: Not a directory.\n"


@pytest.mark.parametrize("settings", ["ppo"], indirect=True)
def test_a_run_leaves_no_temporary_folder_and_its_file_is_checked(settings, tmp_path, capsys, monkeypatch):
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    words = ["ppo", "--env", TRACK, "--settings", str(settings), "--validations", "1", "--episodes", "2"]
    words += ["--out", str(tmp_path / "runs")]
    assert main(words) == 0
    assert not list((tmp_path / "temporary").iterdir())
    file = tmp_path / "runs" / "seed-0" / "run.json"
    about = json.loads(file.read_text(encoding="utf-8"))
    for damaged in ({**about, "validation_score": "high"}, {**about, "validation_score": None}, {**about, "steps": []}):
        file.write_text(json.dumps(damaged), encoding="utf-8")
        assert main(words) == 2
        assert "run.json is damaged, or was written by another version: " in capsys.readouterr().err
