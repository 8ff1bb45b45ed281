"""The search of settings: validation episodes, trials that end early, and whoever is stopped goes on."""

import json
import math
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import optuna
import pytest

from baselines import registry
from baselines.evaluate import evaluate
from baselines.spec import parse_policy
from baselines.tuning import solvers, study
from baselines.tuning.command import main
from baselines.tuning.ranges import Range, read, suggested
from baselines.tuning.settings import Tuning
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError

RANGES = str(Path(__file__).with_name("refused.toml"))
ROOT = Path(__file__).parents[3]
SKEW = scenarios.get("varga7-random")
SHORT = SKEW.replace(name="short", steps=30)


def searched(folder, budget=60, episodes=4, resume=False, workers=1, **changes):
    """The trials of a short search for dls, as (settings, value, state, episodes)."""
    studies = solvers.planned(
        SHORT, ["dls"], solvers.stated(), episodes=episodes, budget=budget, seed=changes.pop("seed", 0), **changes
    )
    folder.mkdir(exist_ok=True)
    study.prepare(folder, studies, resume=resume, overwrite=False)
    study.search(folder, studies, workers=workers, unit="episode", progress=False)
    return trials(folder), studies


def trials(folder):
    found = study.finished(study.opened(folder, "dls"))
    return [(trial.user_attrs["settings"], trial.value, trial.state.name, trial.last_step) for trial in found]


@pytest.fixture(autouse=True)
def without_waiting_for_the_disk(monkeypatch):
    monkeypatch.setattr("os.fsync", lambda _: None)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tuning") / "whole"
    return folder, *searched(folder)


def test_values_are_costs_of_validation_episodes(whole):
    folder, found, studies = whole
    assert sum(episodes for *_, episodes in found) == 56
    tuned = solvers.result(folder, studies, SHORT, "a command")
    (one,) = tuned.solvers
    variants = [("dls", {}), one.variant, ("dls", found[0][0])]
    rows = evaluate(SHORT, variants, episodes=4, split="validation")
    costs = np.exp(np.log([row.total_cost for row in rows]).reshape(3, 4).mean(axis=1))
    assert (one.default, one.tuned) == (pytest.approx(costs[0], rel=1e-6), pytest.approx(costs[1], rel=1e-6))
    assert found[0][1] == pytest.approx(costs[2], rel=1e-12)
    assert one.tuned == pytest.approx(min(value for _, value, state, _ in found if state == "COMPLETE"), rel=1e-6)
    assert tuned.seeds == studies[0].objective.seeds
    assert set(tuned.seeds) <= set(scenarios.SPLITS["validation"])


def test_whoever_is_stopped_ends_with_the_same_trials(whole, tmp_path, monkeypatch):
    real = solvers.Cost.costs
    calls = []

    def stopped(self, *arguments):
        calls.append(1)
        if len(calls) == 6:
            raise KeyboardInterrupt
        return real(self, *arguments)

    with monkeypatch.context() as patched:
        patched.setattr(solvers.Cost, "costs", stopped)
        with pytest.raises(KeyboardInterrupt):
            searched(tmp_path / "study")
    assert len(trials(tmp_path / "study")) == 5
    found, _ = searched(tmp_path / "study", resume=True)
    assert found == whole[1]
    assert searched(tmp_path / "study", resume=True)[0] == found  # the budget is spent
    other, _ = searched(tmp_path / "other", seed=1)
    assert other[0] != found[0]


def test_what_a_killed_process_leaves_hinders_nobody(whole, tmp_path, monkeypatch):
    """Optuna's lock, a line that was not written to its end, and a trial that was under way."""
    monkeypatch.chdir(tmp_path)
    searched(Path("study"), budget=30)
    journal = Path("study") / study.JOURNAL
    before = journal.read_bytes()
    lines = before.splitlines(keepends=True)
    last = max(number for number, line in enumerate(lines) if b'"trial_id"' in line and b'"state":1' in line)
    journal.write_bytes(b"".join(lines[:last]) + lines[last][:-9])
    Path(f"{journal}.lock").write_text("")
    found, _ = searched(Path("study"), resume=True)
    assert found == whole[1]


@pytest.mark.slow
def test_a_process_that_is_killed_is_resumed(tmp_path):
    """Its workers end with it, and the trials that have ended stay."""
    arguments = ["--scenario", "varga7-random", "--policies", "dls", "--episodes", "2", "--budget", "40"]
    arguments += ["--out", str(tmp_path / "out"), "--resume"]
    journal = tmp_path / "out" / study.JOURNAL
    process = subprocess.Popen(
        [sys.executable, "-m", "baselines.tuning.command", *arguments, "--workers", "2"],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    while process.poll() is None and not (journal.exists() and journal.read_bytes().count(b"settings") > 2):
        time.sleep(0.01)
    process.kill()
    assert process.wait() < 0
    before = trials(tmp_path / "out")
    assert not (tmp_path / "out" / "tuned.json").exists()
    assert main(arguments) == 0
    after = trials(tmp_path / "out")
    assert after[: len(before)] == before
    assert Tuning.load(tmp_path / "out" / "tuned.json").solvers[0].tried == len(after) + 1
    assert 38 <= sum(episodes for *_, episodes in after) < 38 + 2 * 2
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == [study.JOURNAL, "tuned.json"]


def test_no_episode_but_those_for_validation_is_played(tmp_path, monkeypatch):
    """Whatever is searched, and however: what scores are published on stays unseen."""
    real, seen = solvers.rollouts, []

    def spy(scenario, policy, seeds):
        seen.extend(seeds)
        return real(scenario, policy, seeds)

    monkeypatch.setattr(solvers, "rollouts", spy)
    _, studies = searched(tmp_path / "study", budget=24, episodes=12)
    solvers.result(tmp_path / "study", studies, SHORT, "a command")
    assert set(seen) == set(range(1_000_000, 1_000_012))
    assert not set(seen) & {*scenarios.SPLITS["test"], *scenarios.SPLITS["train"]}


def test_trials_that_are_worse_end_early(tmp_path, monkeypatch):
    def costs(self, settings, seeds):
        return [settings["damping"]] * len(seeds)

    monkeypatch.setattr(solvers.Cost, "costs", costs)
    found, _ = searched(tmp_path / "study", budget=600, episodes=20)
    early = [one for one in found if one[2] == "PRUNED"]
    assert early
    assert {episodes for *_, episodes in early} <= {8, 16}
    assert all(state == "COMPLETE" for _, _, state, _ in found[: study.STARTUP])
    best = min(value for _, value, _, _ in found if value is not None)
    assert all(settings["damping"] > best for settings, *_ in early)
    whole = [value for _, value, state, _ in found if state == "COMPLETE"]
    assert math.log(np.median(whole[-5:])) < math.log(np.median(whole[:5]))


@pytest.mark.slow
def test_several_processes_share_a_budget(tmp_path):
    """Each of them plays trials, and they spend no more than what those under way add."""
    found, studies = searched(tmp_path / "study", budget=64, workers=2)
    spent = sum(episodes for *_, episodes in found)
    assert studies[0].budget <= spent < studies[0].budget + 2 * 4
    assert len({json.dumps(settings) for settings, *_ in found}) == len(found)


@pytest.mark.parametrize("episodes", [1, 8, 20, 64, 300])
def test_parts_are_all_seeds_in_their_order(episodes):
    seeds = range(episodes)
    found = solvers.parts(seeds)
    assert [seed for part in found for seed in part] == list(seeds)
    assert max(map(len, found)) <= 64
    assert len(found[0]) == min(episodes, solvers.FIRST)


def test_ranges_look_no_further_and_are_taken():
    """Whatever is suggested makes a solver, which is shown no more than as it is."""
    ranges = solvers.stated()
    there = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    for spec in ranges:
        name, parameters = parse_policy(spec)
        lines = solvers.of(spec, ranges)
        ahead = registry.make(name, SKEW, **parameters).preview
        assert ahead <= 2
        for _ in range(8):
            settings = suggested(there.ask(), lines, parameters)
            made = registry.make(name, SKEW, **{**parameters, **settings})
            assert made.preview == ahead
            assert settings


def test_some_solvers_suit_skew_coordinates_alone():
    ranges = solvers.stated()
    assert solvers.suiting(SKEW, ranges) == list(ranges)
    left = {*ranges} - {*solvers.suiting(scenarios.get("varga7-pose-random"), ranges)}
    assert left == {spec for spec in ranges if "full_orientation" in spec}


def test_a_part_of_a_parameter_keeps_the_others():
    ranges = (
        Range("options.gain", 0.1, 0.2),
        Range("rule", choices=("a", "b")),
        Range("x", 1, 3, when={"rule": ["a"]}),
    )
    there, seen = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0)), set()
    for _ in range(20):
        found = suggested(there.ask(), ranges, {"options": {"horizon": 3}})
        assert found["options"]["horizon"] == 3
        assert 0.1 <= found["options"]["gain"] <= 0.2
        assert ("x" in found) == (found["rule"] == "a")
        seen.add(found.get("x"))
    assert seen == {None, 1, 2, 3}


def test_a_fixed_parameter_is_not_searched():
    ranges = solvers.stated()
    assert [one.name for one in solvers.of("dls:gain=0.5", ranges)] == ["damping"]


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("dls = 3", InvalidInputError, "expected a table of ranges"),
        ("[dls", InvalidInputError, "no TOML"),
        ("[dls]\ngain = {}", InvalidInputError, "range of gain: expected low and high"),
        ("[dls]\ngain = { low = 1.0, high = 0.5 }", InvalidInputError, "expected low below high"),
        ("[dls]\ngain = { low = 0.0, high = 0.5, log = true }", InvalidInputError, "above 0 where log is true"),
        ("[dls]\ngain = { low = 0.0, hihg = 0.5 }", UnknownNameError, "Did you mean 'high'"),
        ('[dls]\ngain = { low = "a", high = 0.5 }', InvalidInputError, "two numbers, or choices"),
        ("[dls]\ngain = { low = 0.1, high = inf }", InvalidInputError, "expected low below high"),
        ('[dls]\ngain = { choices = "abc" }', InvalidInputError, "expected a list of choices"),
        ('[dls]\ngain = { low = 1, high = 2, when = { rule = "a" } }', InvalidInputError, "when as a table of lists"),
        (
            '[dls]\ngain = { low = 1, high = 2, when = { rule = ["a"] } }',
            UnknownNameError,
            "parameter above gain 'rule'",
        ),
    ],
)
def test_ranges_that_are_none(tmp_path, text, error, message):
    file = tmp_path / "ranges.toml"
    file.write_text(text)
    with pytest.raises(error, match=message):
        read(file)


def test_the_command(tmp_path, capsys):
    ranges, out = tmp_path / "ranges.toml", tmp_path / "out"
    SHORT.save(tmp_path / "short.toml")
    ranges.write_text("[dls]\ndamping = { low = 1e-3, high = 1e-1, log = true }\n")
    arguments = ["--scenario", "varga7-random", "--policies", "dls", "--episodes", "1", "--budget", "3"]
    arguments += ["--ranges", str(ranges), "--out", str(out)]
    assert main(arguments) == 0
    assert "| solver | as it is | tuned | ratio | tried | settings |" in capsys.readouterr().out
    found = Tuning.load(out / "tuned.json")
    assert found.solvers[0].tried == 3
    assert sorted(file.name for file in out.iterdir()) == ["study.journal", "tuned.json"]
    assert main(arguments) == 2
    assert "is there already: go on with it by --resume" in capsys.readouterr().err
    assert main([*arguments, "--resume", "--seed", "1"]) == 2
    assert "has another search of dls: seed (0 there, 1 here)" in capsys.readouterr().err
    assert main([*arguments, "--resume", "--budget", "4"]) == 0
    assert Tuning.load(out / "tuned.json").solvers[0].tried == 4
    (out / "study.journal").write_text("{}\n[]\n")
    assert main([*arguments, "--resume"]) == 2
    assert "is damaged" in capsys.readouterr().err
    assert main([*arguments, "--overwrite"]) == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"--scenario": "varga7-randm"}, "There is no scenario 'varga7-randm'. Did you mean 'varga7-random"),
        ({"--scenario": "varga7-fast"}, "varga7-fast is the same at every reset"),
        ({"--policies": "dlss"}, "There is no policy 'dlss'. Did you mean 'dls'?"),
        ({"--policies": "rhc_foresight"}, "No range is stated for a parameter of 'rhc_foresight'"),
        (
            {"--policies": "dls:gain=0.5,damping=0.1"},
            "No range is stated for a parameter of 'dls:gain=0.5,damping=0.1'",
        ),
        ({"--policies": "full_orientation", "--scenario": "varga7-pose-random"}, "expected the task 'skew'"),
        ({"--episodes": "0"}, "episodes: expected a whole number of at least 1, got 0."),
        ({"--workers": "0"}, "workers: expected a whole number of at least 1, got 0."),
        ({"--seed": "-1"}, "seed: expected a whole number of at least 0, got -1."),
        ({"--budget": "100"}, "budget: expected episodes for two trials at least, 128, got 100"),
        ({"--ranges": "nowhere.toml"}, "Cannot read the ranges nowhere.toml"),
        ({"--ranges": RANGES, "--policies": "dls"}, "damping: expected a finite number above 0, got -1.0."),
        ({"--ranges": RANGES, "--policies": "mfac"}, "There is no damping rule 'zzz'"),
        ({"--ranges": RANGES, "--policies": "follow_nominal"}, "There is no parameter of follow_nominal 'gain'"),
    ],
)
def test_mistakes_are_one_line_before_anything_is_played(changes, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    given = {"--scenario": "varga7-random", "--policies": "dls", "--out": "out"} | changes
    assert main([part for pair in given.items() for part in pair]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_without_its_extra_it_says_so():
    code = (
        "import sys; sys.modules['optuna'] = None\n"
        "from baselines.console import main\n"
        "sys.exit(main('tune --scenario varga7-random --out x'.split()))"
    )
    ended = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert 'This needs optuna: pip install "ikgym[train]"' in ended.stderr
