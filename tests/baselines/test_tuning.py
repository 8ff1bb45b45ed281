"""The search for settings: validation episodes only, trials that are pruned, and the same trials after a stop."""

import json
import pathlib
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("optuna", reason='needs Optuna: pip install "ikgym[train]"')

import optuna

from baselines import registry, tuning
from baselines.cli.commands.tune import main
from baselines.files import ResultsError
from baselines.registry import parse_policy
from baselines.tuning import Search
from baselines.tuning.ranges import RANGES, ranges_of, read_ranges, suggest
from baselines.tuning.search import DONE, JOURNAL, _study
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError

ROOT = pathlib.Path(__file__).parents[2]
SHORT = scenarios.get("varga7-random").replace(name="short", steps=30)


@pytest.fixture(autouse=True)
def no_waiting_for_the_disk(monkeypatch):
    monkeypatch.setattr("os.fsync", lambda _: None)


@pytest.fixture
def plays():
    """Marks a test that plays episodes."""


@pytest.fixture(autouse=True)
def costs(monkeypatch, request):
    """Costs without an episode, except in tests that play; and the seeds that were asked for."""
    seen = []
    real = Search.costs

    def costs(self, settings, seeds):
        seen.extend(seeds)
        plays = "plays" in request.fixturenames
        return real(self, settings, seeds) if plays else [settings.get("damping", 0.5) + 1e-3 * (s % 7) for s in seeds]

    monkeypatch.setattr(Search, "costs", costs)
    return seen


def run(folder, trials=8, episodes=20, *, resume=False, overwrite=False, workers=1, seed=0):
    (search,) = tuning.searches(SHORT, ["dls"], episodes=episodes, seed=seed)
    folder.mkdir(exist_ok=True)
    (found,) = tuning.run(folder, [search], trials, workers=workers, resume=resume, overwrite=overwrite)
    done = _study(folder / JOURNAL, search).get_trials(states=DONE)
    return found, [(one.user_attrs["settings"], one.value, one.state.name, one.last_step) for one in done]


def test_the_cost_is_the_geometric_mean_over_validation_episodes(tmp_path, costs, plays):
    found, trials = run(tmp_path, 2, 3)
    (search,) = tuning.searches(SHORT, ["dls"], episodes=3)
    assert trials[0][1] == pytest.approx(np.exp(np.mean(np.log(search.costs(trials[0][0], search.seeds)))), rel=1e-12)
    assert found["tried"] == 3
    assert found["tuned"] == pytest.approx(min(found["default"], *(value for _, value, *_ in trials)), rel=1e-6)
    assert set(costs) == {1_000_000, 1_000_001, 1_000_002} <= set(scenarios.SPLITS["validation"])


def test_a_search_that_is_stopped_or_killed_comes_to_the_same_trials(tmp_path, monkeypatch):
    """A killed process leaves Optuna's lock, half a line, and a running trial."""
    _, whole = run(tmp_path / "whole")
    run(tmp_path / "part", 5)
    journal = tmp_path / "part" / JOURNAL
    lines = journal.read_bytes().splitlines(keepends=True)
    last = max(number for number, line in enumerate(lines) if b'"trial_id"' in line and b'"state":1' in line)
    journal.write_bytes(b"".join(lines[:last]) + lines[last][:-9])
    journal.with_name(f"{JOURNAL}.lock").write_text("")
    assert run(tmp_path / "part", resume=True)[1] == whole
    assert run(tmp_path / "other", seed=1)[1] != whole


def test_trials_that_are_worse_are_pruned(tmp_path):
    found, trials = run(tmp_path, 30)
    pruned = [one for one in trials if one[2] == "PRUNED"]
    assert pruned
    assert {episodes for *_, episodes in pruned} <= {8, 16}
    assert all(settings["damping"] > found["settings"]["damping"] for settings, *_ in pruned)


def test_only_the_same_search_is_resumed(tmp_path):
    run(tmp_path, 1)
    with pytest.raises(ResultsError, match="already exists: continue with --resume"):
        run(tmp_path, 1)
    with pytest.raises(ResultsError, match=r"differs in seed .* of dls"):
        run(tmp_path, 1, resume=True, seed=1)
    (tmp_path / JOURNAL).write_text("{}\n[]\n")
    with pytest.raises(ResultsError, match="is damaged"):
        run(tmp_path, 1, resume=True)
    assert run(tmp_path, 1, overwrite=True)[0]["tried"] == 2


@pytest.mark.slow
def test_a_killed_command_is_resumed_by_several_workers(tmp_path, plays):
    arguments = ["--scenario", "varga7-random", "--policies", "dls", "--episodes", "1", "--trials", "12"]
    arguments += ["--out", str(tmp_path), "--resume", "--workers", "2"]
    journal = tmp_path / JOURNAL
    process = subprocess.Popen([sys.executable, "-m", "baselines.cli", "tune", *arguments], cwd=ROOT)
    while process.poll() is None and not (journal.exists() and journal.read_bytes().count(b"settings") > 2):
        time.sleep(0.01)
    process.kill()
    assert process.wait() < 0
    assert not (tmp_path / "tuned.json").exists()
    assert main(arguments) == 0
    (found,) = json.loads((tmp_path / "tuned.json").read_text())["solvers"]
    assert 12 < found["tried"] <= 12 + 2
    assert sorted(file.name for file in tmp_path.iterdir()) == [JOURNAL, "tuned.json"]


def test_settings_of_all_ranges_make_a_solver_that_looks_no_further():
    ranges = read_ranges(RANGES)
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    for one in tuning.searches(scenarios.get("varga7-random")):
        ahead = one.make({}).preview
        for _ in range(8):
            settings = suggest(study.ask(), one.ranges, parse_policy(one.spec)[1])
            assert settings
            assert one.make(settings).preview == ahead
    left_out = {*ranges} - {one.spec for one in tuning.searches(scenarios.get("varga7-pose-random"))}
    assert left_out == {spec for spec in ranges if "full_orientation" in spec}


def test_parameters_within_another_and_under_a_condition():
    ranges = {
        "options.gain": {"low": 0.1, "high": 0.2},
        "rule": {"choices": ["a", "b"]},
        "x": {"low": 1, "high": 3, "when": {"rule": ["a"]}},
    }
    study, seen = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0)), set()
    for _ in range(20):
        found = suggest(study.ask(), ranges, {"options": {"horizon": 3}})
        assert found["options"]["horizon"] == 3
        assert 0.1 <= found["options"]["gain"] <= 0.2
        assert ("x" in found) == (found["rule"] == "a")
        seen.add(found.get("x"))
    assert seen == {None, 1, 2, 3}
    assert list(ranges_of("dls:gain=0.5", read_ranges(RANGES))) == ["damping"]


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("dls = 3", InvalidInputError, "expected a table of ranges"),
        ("[dls]\ngain = {}", InvalidInputError, r"\[dls\] gain: expected low and high, or choices"),
        ("[dls]\ngain = { low = 1.0, high = 0.5 }", InvalidInputError, "expected low and high, or choices"),
        ("[dls]\ngain = { low = 0.0, hihg = 0.5 }", UnknownNameError, "Did you mean 'high'"),
        ('[dls]\ngain = { low = 1, high = 2, when = { rule = ["a"] } }', UnknownNameError, "parameter above gain"),
        ("[dls]\ndamping = { low = -1.0, high = 1.0 }", InvalidInputError, "damping: expected a finite number above 0"),
        ('[mfac]\nrule = { choices = ["constant", "zzz"] }', UnknownNameError, "There is no damping rule 'zzz'"),
        (
            "[follow_nominal]\ngain = { low = 0.1, high = 1.0 }",
            UnknownNameError,
            "no parameter 'gain' of follow_nominal",
        ),
    ],
)
def test_invalid_ranges(tmp_path, text, error, message):
    file = tmp_path / "ranges.toml"
    file.write_text(text)
    with pytest.raises(error, match=message):
        tuning.searches(SHORT, [text[1:].partition("]")[0]], file)


def test_ranges_of_solvers_that_are_not_searched(tmp_path):
    (tmp_path / "ranges.toml").write_text("[mfac]\ndamping = { low = 0.1, high = 1.0 }")
    with pytest.raises(InvalidInputError, match="expected ranges of a solver that is searched, dls"):
        tuning.searches(SHORT, ["dls"], tmp_path / "ranges.toml")
    tuning.searches(SHORT, ["dls", "mfac"], tmp_path / "ranges.toml")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"--scenario": "varga7-randm"}, "There is no scenario 'varga7-randm'. Did you mean 'varga7-random"),
        ({"--scenario": "varga7-fast"}, "varga7-fast is the same at every reset"),
        ({"--policies": "dlss"}, "There is no policy 'dlss'. Did you mean 'dls'?"),
        ({"--policies": "rhc_foresight"}, "There are no ranges for the parameters of 'rhc_foresight'"),
        ({"--ranges": "nowhere.toml"}, "Cannot read nowhere.toml"),
        ({"--ranges": str(RANGES), "--policies": "rhc:horizon=7"}, "There are no ranges"),
    ],
)
def test_the_command_reports_mistakes_before_anything_is_written(changes, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    given = {"--scenario": "varga7-random", "--policies": "dls", "--out": "out"} | changes
    assert main([part for pair in given.items() for part in pair]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_command(tmp_path, capsys):
    arguments = ["--scenario", "varga7-random", "--policies", "dls", "--episodes", "1", "--trials", "2"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    assert "dls: " in capsys.readouterr().out
    about = json.loads((tmp_path / "tuned.json").read_text())
    assert (about["scenario"], about["split"], about["episodes"]) == ("varga7-random", "validation", 1)
    name, parameters = parse_policy(about["solvers"][0]["spec"])
    registry.make(name, SHORT, **{**parameters, **about["solvers"][0]["settings"]})
