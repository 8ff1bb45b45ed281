"""The search of hyperparameters: trials are trainings, and the best one is a preset."""

import json
import math
from pathlib import Path

import optuna
import pytest

from baselines.training import run, study, validation
from baselines.training.command import main
from baselines.training.errors import TrainingError
from baselines.training.presets import read as preset
from baselines.training.run import Result
from baselines.training.score import Score
from baselines.training.seeds import SeedRuns
from baselines.tuning.study import opened
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.training.small import about, tiny

TINY = [
    "--scenario", "faitli3-regular", "--steps", "20", "--hidden", "8", "--offsets", "1", "2", "10", "--segments", "2",
    "--evaluate-every", "1", "--n-envs", "4", "--validation-episodes", "1", "--no-progress",
]  # fmt: skip
RANGES = "[ppo]\nlearning_rate = { low = 1e-5, high = 1e-2, log = true }\nbatch_size = { choices = [20, 40] }\n"


@pytest.fixture(autouse=True)
def without_waiting_for_the_disk(monkeypatch):
    monkeypatch.setattr("os.fsync", lambda _: None)


@pytest.fixture
def ranges(tmp_path):
    file = tmp_path / "ranges.toml"
    file.write_text(RANGES)
    return str(file)


def test_its_best_trial_is_a_preset(tmp_path, ranges, capsys):
    arguments = ["ppo", *TINY, "--study", "3", "--study-ranges", ranges, "--out", str(tmp_path / "study")]
    assert main(arguments) == 0
    assert "best of 3 trials" in capsys.readouterr().out
    trials = opened(tmp_path / "study", "ppo").trials
    best = min(trials, key=lambda trial: trial.value)
    for trial in trials:
        there = about(tmp_path / "study" / f"trial-{trial.number}")
        assert there["kept"]["validation"]["cost"] == trial.value
        assert trial.user_attrs["options"].items() <= there["config"].items()
        assert trial.last_step == 2
    options = preset(str(tmp_path / "study" / "best.toml"))
    assert options == {"method": "ppo", **best.user_attrs["options"]}
    assert main([*arguments[:-1], str(tmp_path / "study")]) == 2
    assert "is there already: go on with it by --resume" in capsys.readouterr().err
    assert main([*arguments, "--resume"]) == 0
    assert len(opened(tmp_path / "study", "ppo").trials) == 3
    again = ["ppo", *TINY, "--preset", str(tmp_path / "study" / "best.toml"), "--out", str(tmp_path / "again")]
    assert main(again) == 0
    assert about(tmp_path / "again" / "seed-0")["kept"]["validation"]["cost"] == best.value


def test_agents_are_judged_on_validation_episodes(tmp_path, monkeypatch, ranges):
    """And trained on those for training: what scores are published on stays unseen."""
    real, judged = validation.play, []

    def spy(actor, processing, scenario, seeds):
        judged.extend(seeds)
        return real(actor, processing, scenario, seeds)

    monkeypatch.setattr(validation, "play", spy)
    config = tiny("ppo", scenario="varga7-random", segments=1, evaluate_every=1)
    study.searched(SeedRuns(config, tmp_path), 0, trials=1, ranges=Path(ranges), workers=1, progress=False)
    assert set(judged) == {1_000_000, 1_000_001}


def test_options_that_do_not_suit_each_other_cost_a_trial(tmp_path, capsys):
    file = tmp_path / "ranges.toml"
    file.write_text("[ppo]\nbatch_size = { choices = [7, 40] }\n")
    arguments = ["ppo", *TINY, "--study-ranges", str(file), "--seeds", "1", "--out", str(tmp_path / "study")]
    assert main([*arguments, "--study", "4"]) == 0
    trials = opened(tmp_path / "study", "ppo").trials
    refused = [trial for trial in trials if trial.user_attrs["options"]["batch_size"] == 7]
    assert 0 < len(refused) < 4
    assert {trial.value for trial in refused} == {math.inf}
    assert f"without an agent, {len(refused)} of them: batch_size: expected a divisor" in capsys.readouterr().out
    file.write_text("[ppo]\nbatch_size = { choices = [7] }\n")
    assert main([*arguments[:-1], str(tmp_path / "none"), "--study", "1"]) == 2
    assert "None of 1 trials has an agent: batch_size: expected a divisor" in capsys.readouterr().err


def test_trials_that_diverge_or_are_worse(tmp_path, monkeypatch):
    """Those whose weights diverge cost infinitely much; those that are worse than others end early."""
    runs = SeedRuns(tiny("ppo"), tmp_path)

    def worse(config, seed, path, *, on_segment, **_):
        number = int(path.name.removeprefix("trial-"))
        if number == 0:
            raise TrainingError("The weights were no longer finite")
        score = Score(1, 1.0 + number, None, 0.0, 0.0)
        for done in range(1, config.segments + 1):
            on_segment(done, score)
        return Result(path, "", score)

    monkeypatch.setattr(run, "train", worse)
    study.searched(runs, 0, trials=9, ranges=None, workers=1, progress=False)
    trials = opened(tmp_path, "ppo").trials
    assert trials[0].value == float("inf")
    assert "no longer finite" in trials[0].user_attrs["error"]
    assert [trial.state.name for trial in trials[:5]] == ["COMPLETE"] * 5
    assert {trial.state for trial in trials[6:]} == {optuna.trial.TrialState.PRUNED}
    assert {trial.last_step for trial in trials[6:]} == {1}


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("[sac]\ntau = { low = 0.1, high = 0.2 }", InvalidInputError, r"No range is stated for an option of ppo"),
        ("[ppo]\ntau = { low = 0.1, high = 0.2 }", UnknownNameError, "There is no option of ppo 'tau'"),
        ("[ppo]\nlearning_rate = { low = -0.1, high = 0.2 }", InvalidInputError, "learning_rate: expected"),
    ],
)
def test_ranges_that_are_none(tmp_path, text, error, message):
    file = tmp_path / "ranges.toml"
    file.write_text(text)
    with pytest.raises(error, match=message):
        study.planned(SeedRuns(tiny("ppo"), tmp_path), 0, 3, file)


@pytest.mark.parametrize("method", ["ppo", "sac", "td3", "imitate", "apg"])
def test_every_method_has_ranges_that_it_takes(method, tmp_path):
    planned = study.planned(SeedRuns(tiny(method), tmp_path), 0, 3, None)
    there = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    for _ in range(5):
        options = study.suggested(there.ask(), planned.objective.ranges, {})
        assert json.loads(json.dumps(options)) == options
        assert study.with_options(tiny(method), options).to_json().items() >= options.items()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--study", "0"], "study: expected a whole number of at least 1, got 0."),
        (["--study", "2", "--seeds", "1", "2"], "seeds: expected one for a study, got 1, 2."),
        (["--study-ranges", "x.toml"], "expected --study"),
        (["--study", "2", "--study-ranges", "x.toml"], "Cannot read the ranges x.toml"),
    ],
)
def test_mistakes_are_one_line(more, message, tmp_path, capsys):
    assert main(["ppo", *TINY, "--out", str(tmp_path / "study"), *more]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1
    assert not (tmp_path / "study").exists()
