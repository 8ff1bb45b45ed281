"""Agents from files in evaluations: rows, what goes on with what, and the command line."""

from __future__ import annotations

import dataclasses

import pytest

import ikgym
from baselines import registry
from baselines.evaluate import evaluate, main, manual
from baselines.evaluation import report
from baselines.evaluation.metrics import TIME_COLUMNS
from baselines.evaluation.plan import make_plan
from baselines.evaluation.results import read_rows
from baselines.evaluation.runner import play
from baselines.evaluation.summary import summarise
from baselines.files import ResultsError
from ikgym.exceptions import InvalidInputError
from tests.baselines.random_agents import OFFSETS, write_agent

STEPS = 15
SCENARIO = ikgym.scenarios.get("varga7-random")


@pytest.fixture
def file(tmp_path):
    return write_agent(tmp_path / "mine.safetensors", SCENARIO, "dls:damping=1e-2")


def run(file, **options):
    return evaluate("varga7-random", f"agent:{file}", **{"episodes": 3, "steps": STEPS, "plots": False, **options})


def timeless(rows):
    return [dataclasses.replace(row, **dict.fromkeys(TIME_COLUMNS, 0)) for row in rows]


def test_rows(file):
    rows = run(file)
    digits = registry.make("agent", SCENARIO, path=file).hash
    assert len(rows) == 3
    for row in rows:
        assert row.policy == "agent"
        assert row.parameters == {"path": file, "trust": False, "offsets": None, "hash": digits, "any_arm": False}
        assert row.preview == OFFSETS[-1]
    assert list(report.labels(summarise(rows)).values()) == [f"agent:path={file}"]


def test_an_agent_that_corrects_nothing_costs_what_its_base_policy_costs(tmp_path):
    zero = write_agent(tmp_path / "zero.safetensors", SCENARIO, "dls:damping=1e-2", zero=True)
    ours, theirs = run(zero), evaluate("varga7-random", "dls:damping=1e-2", episodes=3, steps=STEPS)
    assert [row.total_cost for row in ours] == [row.total_cost for row in theirs]


def test_workers_and_what_is_shown_change_nothing(file, tmp_path):
    rows = run(file)
    assert timeless(run(file, workers=2, timed=2, out=tmp_path / "out")) == timeless(rows)
    # played already, and so not again
    assert run(file, workers=2, timed=2, out=tmp_path / "out", resume=True) == read_rows(tmp_path / "out/results.json")
    longer = run(file, preview=30)
    assert [row.preview for row in longer] == [30] * 3
    assert [row.total_cost for row in longer] == [row.total_cost for row in rows]
    with pytest.raises(InvalidInputError, match=r"agent needs to be shown the steps \(1, 2, 5, 20\) ahead"):
        run(file, preview=10)


def test_another_agent_in_the_same_file_is_another_policy(file, tmp_path):
    out = tmp_path / "out"
    first = run(file, out=out)
    write_agent(tmp_path / "mine.safetensors", SCENARIO, "dls:damping=1e-2", seed=1)
    second = run(file, out=out, resume=True)
    assert [row.total_cost for row in first] != [row.total_cost for row in second]
    assert read_rows(out / "results.json") == [*first, *second]
    labels = list(report.labels(summarise([*first, *second])).values())
    assert len(set(labels)) == 2
    assert all("hash=" in label for label in labels)


def test_a_file_that_changes_while_it_is_played(file, tmp_path):
    job = make_plan("varga7-random", f"agent:{file}", steps=STEPS).jobs[0]
    assert play([job])
    write_agent(tmp_path / "mine.safetensors", SCENARIO, "dls:damping=1e-2", seed=1)
    with pytest.raises(ResultsError, match="agent has changed since the evaluation began"):
        play([job])


def test_scenarios_that_do_not_fit_are_left_out(file):
    plan = make_plan(["khan8-q1", "varga7-fast"], [f"agent:{file}", "dls"])
    assert [(job.scenario.name, job.policy) for job in plan.jobs] == [
        ("khan8-q1", "dls"),
        ("varga7-fast", "agent"),
        ("varga7-fast", "dls"),
    ]
    assert [s.policy for s in plan.skipped] == ["agent"]
    assert "was trained for 7 joints" in plan.skipped[0].reason
    with pytest.raises(InvalidInputError, match=r"Nothing to evaluate: agent in khan8-q1: Agent .* was trained for 7"):
        make_plan("khan8-q1", f"agent:{file}")


def test_files_that_cannot_be_used_stop_everything(file, tmp_path):
    with pytest.raises(ResultsError, match=r"mime.safetensors does not exist\. Did you mean '.*mine\.safetensors'\?"):
        make_plan("varga7-fast", ["dls", f"agent:{tmp_path}/mime.safetensors"])
    (tmp_path / "damaged.safetensors").write_bytes(b"0" * 100)
    with pytest.raises(ResultsError, match="is cut off, or no safetensors file"):
        make_plan("varga7-fast", ["dls", f"agent:{tmp_path}/damaged.safetensors"])


def test_trust_is_passed_on_to_agents_only(file):
    plan = make_plan("varga7-fast", [f"agent:{file}", ("agent", {"path": file, "trust": False}), "dls"], trust=True)
    assert [job.parameters.get("trust") for job in plan.jobs] == [True, False, None]


def test_command_line(file, tmp_path, capsys):
    arguments = ["--scenarios", "varga7-random", "--steps", "5", "--no-plots", "--policies", "dls"]
    assert main([*arguments, f"agent:{file}", "--out", str(tmp_path / "out"), "--trust"]) == 0
    assert f"agent:path={file}" in capsys.readouterr().out
    rows = read_rows(tmp_path / "out/results.json")
    assert [row.parameters.get("trust") for row in rows] == [None, True]
    assert main([*arguments, f"agent:{tmp_path}/my.safetensors"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: Agent ")
    assert "Did you mean" in said
    assert main([*arguments, "agent"]) == 2
    assert "as in agent:PATH" in capsys.readouterr().err
    assert "agent:" in manual()


def test_agents_of_the_package_go_by_their_names():
    rows = evaluate("varga7-random", ["agent_alone", "dls"], steps=STEPS)
    assert list(report.labels(summarise(rows)).values()) == ["agent_alone", "dls"]
    assert rows[0].parameters == {"hash": registry.make("agent_alone", SCENARIO).file.digits}
