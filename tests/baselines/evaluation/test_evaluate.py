import csv
import dataclasses
import json

import numpy as np
import pytest

import baselines
import ikgym
from baselines.cli.commands.evaluate import main
from baselines.evaluate import evaluate
from baselines.evaluation import run as module
from baselines.evaluation.jobs import Options
from baselines.evaluation.metrics import TIME_COLUMNS, Row, describe
from baselines.evaluation.results import PAGE, Results, read_rows
from baselines.evaluation.run import MOST, batches
from baselines.files import ResultsError
from baselines.registry import parse_policy
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.evaluation.planning import planned

STEPS = 15
COLUMNS = tuple(field.name for field in dataclasses.fields(Row))
SET = {"test_sets": "varga7-random"}
FAST = ikgym.scenarios.get("varga7-fast")


def timeless(rows):
    return [dataclasses.replace(row, **dict.fromkeys(TIME_COLUMNS, 0)) for row in rows]


def strict_json(file):
    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(file.read_text(encoding="utf-8"), parse_constant=refuse)


def run_all(out=None, **changes):
    options = {"episodes": 2, "steps": STEPS, "out": out, **changes}
    return evaluate(["varga7-random", "zhang3-helix"], ["dls", "moore_penrose", "follow_nominal"], **options)


# What is evaluated


def test_order_and_seeds_of_the_rows():
    rows = run_all()
    assert isinstance(rows, list)
    assert [(one.scenario, one.policy) for one in rows.skipped] == [("zhang3-helix", "follow_nominal")]
    assert "Cartesian" in rows.skipped[0].reason
    random = [(name, seed) for name in ("dls", "moore_penrose", "follow_nominal") for seed in (2_000_000, 2_000_001)]
    assert [(row.scenario, row.policy, row.seed) for row in rows] == [
        *(("varga7-random", *one) for one in random),
        *(("zhang3-helix", name, 0) for name in ("dls", "moore_penrose")),
    ]
    assert all(row.steps == STEPS and row.preview == 1 for row in rows)
    assert rows[0].parameters == baselines.make("dls", "varga7-random").parameters
    assert rows[0].machine == describe()
    assert set(rows[0].machine) == {"cpu", "cores", "system", "python", "numpy", "numba", "ikgym"}
    # A reference plays the episode that it knows.
    one, other = (row for row in rows if row.policy == "follow_nominal")
    assert max(one.position_error_max, other.position_error_max) < 1e-8
    assert one.total_cost != other.total_cost
    assert "seed" not in one.parameters


def test_a_scenario_that_is_always_the_same_has_one_episode_unless_there_is_noise():
    assert [job.seeds.seed for job in planned("varga7-fast", "dls", episodes=5).jobs] == [0]
    jobs = planned(FAST.replace(plant=ikgym.Plant(noise=0.1)), "dls", episodes=2).jobs
    assert [(job.seeds.seed, job.first) for job in jobs] == [(2_000_000, True), (2_000_001, False)]


def test_all_stands_for_all():
    assert {job.scenario.name for job in planned("all", "dls").jobs} == set(ikgym.scenarios.names())
    plan = planned("varga7-fast", "all")
    assert {job.policy for job in plan.jobs} | {s.policy for s in plan.skipped} == set(baselines.names())


@pytest.mark.parametrize(
    ("spec", "parameters"),
    [
        ("dls", {}),
        (" dls : damping = 1e-2 , gain = 0.5 ", {"damping": 1e-2, "gain": 0.5}),
        ("dls:gain='analytic'", {"gain": "analytic"}),
        ("dls:damping=(1, [2, 3]),gain=1", {"damping": (1, [2, 3]), "gain": 1}),
        ("dls:damping=__import__('os').getcwd()", {"damping": "__import__('os').getcwd()"}),
    ],
)
def test_policies_are_parsed_and_text_is_never_run(spec, parameters):
    assert parse_policy(spec) == ("dls", parameters)


@pytest.mark.parametrize(
    ("scenarios", "policies", "options", "error", "message"),
    [
        ("varga7-fest", "dls", {}, UnknownNameError, "no scenario 'varga7-fest'. Did you mean 'varga7-fast'"),
        ("varga7-fast", "dsl", {}, UnknownNameError, "no policy 'dsl'. Did you mean 'dls'"),
        ("varga7-fast", "dls:dampin=1", {}, UnknownNameError, "no parameter 'dampin' of dls. Did you mean 'damping'"),
        ("varga7-fast", "dls:damping", {}, InvalidInputError, "expected name=value,…, got 'damping'"),
        ("varga7-fast", "dls:damping=1,damping=2", {}, InvalidInputError, "'damping' is given twice"),
        ("varga7-fast", [("dls", 3)], {}, InvalidInputError, "expected 'name:parameter=value' or"),
        ("varga7-fast", "dls", {"episodes": 0}, InvalidInputError, "episodes: expected a whole number of at least 1"),
        ("varga7-fast", "dls", {"preview": 0}, InvalidInputError, "preview: expected a whole number of at least 1"),
        ("varga7-fast", "dls", {"export": "cvs"}, UnknownNameError, "no format 'cvs' of export. Did you mean 'csv'"),
        ("varga7-fast", "dls", {"export": "csv"}, InvalidInputError, "export: expected a folder for the files"),
        ("varga7-fast", "dls", {"wrap": lambda env: env}, InvalidInputError, "wrap: expected a policy that uses it"),
        ("varga7-fast", 3, {}, InvalidInputError, "expected a name, 'package.module:Class', a class, or an object"),
        ("varga7-fast", dict, {}, InvalidInputError, "expected a class with the predict of Stable-Baselines3"),
        ((), "dls", {"test_sets": "varga7-randm"}, UnknownNameError, "no test set 'varga7-randm'. Did you mean"),
        ("varga7-fast", "dls", SET, InvalidInputError, "A test set defines the episodes"),
        ((), "dls", {**SET, "episodes": 2}, InvalidInputError, "A test set defines the episodes"),
        ([], "dls", {}, InvalidInputError, "Nothing to evaluate"),
        ([FAST, FAST.replace(dt=2e-3)], "dls", {}, InvalidInputError, "Two different scenarios are called"),
    ],
)  # fmt: skip
def test_bad_input_is_refused(scenarios, policies, options, error, message):
    with pytest.raises(error, match=message):
        evaluate(scenarios, policies, **options)


# Batches


def test_episodes_of_a_policy_in_a_scenario_are_played_together():
    jobs = planned(["varga7-random", "varga7-fast"], ["dls", "dls:damping=1e-2"], episodes=MOST + 3, timed=2).jobs
    parts = batches(jobs)
    assert [job for part in parts for job in part] == jobs
    assert [len(part) for part in parts] == [1, 1, MOST, 1] * 2 + [1, 1]
    assert [part[0].timed for part in parts] == [True, True, False, False] * 2 + [True, True]
    for part in parts:
        assert len({(job.scenario.name, job.policy, str(job.parameters)) for job in part}) == 1


def test_timing_changes_nothing_but_the_times(tmp_path):
    options = {"episodes": 4, "steps": STEPS}
    rows = {timed: evaluate("varga7-random", ["dls", "smoothed"], timed=timed, **options) for timed in (1, 2, "all")}
    assert len({row.total_cost for row in rows[1]}) == 8
    for timed, number in ((1, 1), (2, 2), ("all", 4)):
        assert timeless(rows[timed]) == timeless(rows[1])
        measured = [row.time_first_us is not None for row in rows[timed]]
        assert measured == 2 * ([True] * number + [False] * (4 - number))
    # Episodes that are to be timed after all are played again.
    options = {"episodes": 3, "steps": 5, "out": tmp_path}
    rows = evaluate("varga7-random", "dls", **options)
    again = evaluate("varga7-random", "dls", timed=2, resume=True, **options)
    assert [row.time_first_us is not None for row in again] == [True, True, False]
    assert (again[0], again[2]) == (rows[0], rows[2])
    assert timeless(again) == timeless(rows)


# Workers


def test_workers_change_nothing_but_the_times(tmp_path):
    rows = run_all(episodes=4)
    assert timeless(run_all(tmp_path, workers=2, episodes=4)) == timeless(rows)
    assert timeless(read_rows(tmp_path / "results.json")) == timeless(rows)


# Files


def test_files(tmp_path):
    rows = run_all(tmp_path)
    content = strict_json(tmp_path / "results.json")
    assert [Row(**Row.nan_restored(values)) for values in content] == rows == read_rows(tmp_path / "results.json")
    assert content[0]["cost_ratio"] is None
    assert content[-1]["orientation_error_max"] is None
    with (tmp_path / "results.csv").open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    assert tuple(table[0]) == COLUMNS
    contract = (
        "scenario policy parameters seed steps total_cost tracking_cost velocity_cost cost_ratio position_error_max "
        "position_error_rms orientation_error_max orientation_error_rms qdot_peak qdot_rms qdot_total_variation "
        "qddot_peak steps_at_joint_limit steps_at_velocity_limit steps_at_acceleration_limit joint_limit_margin_min "
        "followed solver_status time_p50_us time_p99_us deadline_misses"
    )
    assert COLUMNS[:26] == tuple(contract.split())
    for cells, row in zip(table, rows, strict=True):
        assert (float(cells["total_cost"]), cells["cost_ratio"]) == (row.total_cost, "")
        assert [json.loads(cells[name]) for name in ("parameters", "machine")] == [row.parameters, row.machine]
    assert {p.name for p in tmp_path.iterdir()} == {"README.md", PAGE, "results.csv", "results.json", "series"}
    assert [len(list(tmp_path.glob(f"series/{name}/*.npz"))) for name in ("varga7-random", "zhang3-helix")] == [3, 2]


def test_series_are_the_trajectory_log_of_the_first_episode_at_the_steps_that_count(tmp_path):
    held = ikgym.scenarios.get("khan8-q7q8")
    (row,) = evaluate(held, "dls", steps=620, out=tmp_path)
    plan = planned(held, "dls", steps=620)
    series = Results(plan.jobs, Options(out=tmp_path, resume=True)).series(row)
    counted = np.flatnonzero(plan.jobs[0].scenario.counted())
    assert len(counted) == 12
    np.testing.assert_allclose(series["time"], counted * held.dt)
    assert series["position_error"].max() == row.position_error_max
    assert series["pose"].shape == series["nominal"].shape == (12, 12)
    assert series["q"].shape == (12, 8)


def interrupted(monkeypatch, after):
    play, played = module.play, []

    def interrupt(batch, tick):
        if len(played) == after:
            raise KeyboardInterrupt
        played.append(batch)
        return play(batch, tick)

    monkeypatch.setattr(module, "play", interrupt)


# One episode of each policy is timed. The others of dls and moore_penrose are one batch, those of the reference two.
def test_an_interrupted_run_goes_on_to_the_same_results(tmp_path, monkeypatch):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    rows = run_all(whole, episodes=3)
    with monkeypatch.context() as patch:
        interrupted(patch, 8)
        with pytest.raises(KeyboardInterrupt):
            run_all(parts, episodes=3)
    kept = read_rows(parts / "results.json")
    assert len(kept) == 10
    assert timeless(run_all(parts, episodes=3, resume=True)) == timeless(rows)
    there = read_rows(parts / "results.json")
    assert there[:10] == kept  # not played again: even the times are those of before
    assert timeless(there) == timeless(read_rows(whole / "results.json"))
    for file in whole.glob("series/*/*.npz"):
        with np.load(file) as one, np.load(parts / file.relative_to(whole)) as other:
            assert set(one) == set(other)
            assert all((one[name] == other[name]).all() for name in one)


def test_resuming_adds_episodes_and_policies(tmp_path):
    evaluate("varga7-random", "dls", steps=5, out=tmp_path)
    before = (tmp_path / "results.json").read_bytes()
    with pytest.raises(ResultsError, match=r"results\.json already exists: continue with --resume"):
        evaluate("varga7-random", "dls", episodes=2, steps=5, out=tmp_path)
    assert (tmp_path / "results.json").read_bytes() == before
    rows = evaluate("varga7-random", "dls", episodes=2, steps=5, out=tmp_path, resume=True)
    assert [row.seed for row in rows] == [2_000_000, 2_000_001]
    evaluate("varga7-random", "moore_penrose", steps=5, out=tmp_path, resume=True)
    there = read_rows(tmp_path / "results.json")
    assert [row.policy for row in there] == ["dls", "dls", "moore_penrose"]
    assert "moore_penrose" in (tmp_path / "README.md").read_text(encoding="utf-8")
    (file,) = tmp_path.glob("series/varga7-random/dls-*.npz")
    file.unlink()  # a log that is missing is written again
    evaluate("varga7-random", "dls", steps=5, out=tmp_path, resume=True)
    assert file.exists()


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        ({"machine": {"ikgym": "0.0.1"}}, {}, r"version of ikgym \('0\.0\.1' there"),
        ({"fingerprint": "000000000000"}, {}, r"fingerprint \('000000000000' there"),
        ({}, {"steps": 6}, r"steps \(5 there, 6 here\), .* of dls in varga7-random"),
        ({}, {"split": "validation"}, r"split \('test' there, 'validation' here\)"),
        ({}, {"preview": 3}, r"preview \(1 there, 3 here\)"),
        ({"test_set": "0123456789ab"}, {}, r"test set \('0123456789ab' there, None here\)"),
    ],
)
def test_what_cannot_be_compared_is_not_gone_on_with(tmp_path, change, options, message):
    evaluate("varga7-random", "dls", steps=5, out=tmp_path)
    file = tmp_path / "results.json"
    file.write_text(json.dumps([{**row, **change} for row in strict_json(file)]), encoding="utf-8")
    before = file.read_bytes()
    with pytest.raises(ResultsError, match=message):
        evaluate("varga7-random", "dls", **{"steps": 5, **options}, out=tmp_path, resume=True)
    assert file.read_bytes() == before


def test_names_that_look_alike_or_are_long_have_files_of_their_own(tmp_path):
    names = ["a/b", "a_b", "a b", "ä" * 300, "ä" * 301]
    evaluate([FAST.replace(name=name) for name in names], "dls", steps=3, out=tmp_path, export="csv", report=False)
    assert len(list((tmp_path / "series").glob("*/*.npz"))) == len(list((tmp_path / "export").glob("*/*"))) == 5
    assert (tmp_path / "series" / "a_b").is_dir()


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("link", ["series", "export/varga7-fast"])
def test_no_link_to_another_folder_is_followed(link, overwrite, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    out = tmp_path / "out"
    (out / link).parent.mkdir(parents=True)
    (out / link).symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    (out / "README.md").touch()
    with pytest.raises(ResultsError, match=rf"{link} is a link to another folder"):
        evaluate(FAST, "dls", steps=3, out=out, overwrite=overwrite, export="csv")
    assert not list((tmp_path / "elsewhere").iterdir())
    assert (out / "README.md").exists()  # refused before anything is deleted


def test_a_folder_that_cannot_be_written_is_refused_before_any_work(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("mine")
    interrupted(monkeypatch, 0)
    with pytest.raises(ResultsError, match="Cannot write into"):
        run_all(tmp_path / "file" / "below")


# The command line


def test_help_names_the_columns(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    text = capsys.readouterr().out
    assert all(column in text for column in COLUMNS)
