"""Single lines of a leaderboard are played anew; the others stay as they were measured."""

from __future__ import annotations

import pytest

from baselines.evaluation.machine import describe
from baselines.evaluation.pages import command, entries
from baselines.evaluation.pages.command import main
from baselines.evaluation.pages.entries import solver
from baselines.evaluation.pages.markdown import conditions
from baselines.evaluation.pages.measurement import Measurement
from tests.baselines.evaluation.pages.builders import TEST_SEEDS, a_measurement, a_section, line, write_runs


@pytest.fixture
def docs(tmp_path, monkeypatch):
    """A leaderboard of two episodes, whose plots and text are left out; they take a while."""
    monkeypatch.setattr(command, "draw_up", lambda found, page, folder: found.save(folder / f"{page}.json"))
    monkeypatch.setattr(command, "solvers", lambda *_: (solver("dls"), solver("broyden")))
    monkeypatch.setattr(entries, "policy_of", lambda folder: ("dls", {"damping": 10.0 ** -int(folder.name[5:])}))
    write_runs(tmp_path / "ppo", 2)
    (tmp_path / "docs").mkdir()
    lines = line(), line("broyden")
    changed = a_section(*lines, seeds=TEST_SEEDS[:2], name="varga7-pose-random-frequency")
    a_measurement(a_section(*lines, seeds=TEST_SEEDS[:2]), changed).save(tmp_path / "docs" / "leaderboard.json")
    return tmp_path / "docs"


def renew(docs, *labels):
    where = docs.parent
    agents = ["--agents", f"PPO={where / 'ppo'}"]
    return main(["--renew", *labels, *agents, "--out", str(where / "out"), "--write", str(docs), "--overwrite"])


def test_what_is_named_is_played_and_the_rest_stays(docs):
    before = Measurement.load(docs / "leaderboard.json")
    assert renew(docs, "PPO", "broyden") == 0
    found = Measurement.load(docs / "leaderboard.json")
    own, changed = found.sections
    assert [one.label for one in own.lines] == ["dls", "PPO", "broyden"]
    assert own.lines[0] == before.sections[0].lines[0]
    assert own.lines[2].cost != before.sections[0].lines[1].cost
    assert [len(one.cost) for one in own.lines] == [1, 2, 1]
    assert own.lines[1].time_p50_us is None  # the page was measured on another machine
    # Agents play what differs, too; broyden does not.
    assert {one.label: one.cost != line().cost for one in changed.lines} == {
        "dls": False,
        "broyden": False,
        "PPO": True,
    }
    assert (found.command, found.date) == (before.command, before.date)
    (renewal,) = found.renewals
    assert renewal.labels == ("PPO", "broyden")
    assert "--renew PPO broyden" in renewal.command
    assert f"- played later, on {renewal.date}: `PPO`, `broyden`, by `{renewal.command}`" in conditions(found)


def test_a_line_was_played_by_the_last_command_that_played_it(docs):
    assert renew(docs, "PPO", "broyden") == 0
    assert renew(docs, "broyden") == 0
    found = Measurement.load(docs / "leaderboard.json")
    assert [one.labels for one in found.renewals] == [("PPO",), ("broyden",)]
    assert len(found.sections[0].lines) == 3


def test_it_is_timed_on_the_machine_of_the_page(docs):
    there = Measurement.load(docs / "leaderboard.json")
    Measurement(there.command, there.date, describe(), there.sections).save(docs / "leaderboard.json")
    assert renew(docs, "broyden") == 0
    assert Measurement.load(docs / "leaderboard.json").sections[0].lines[-1].time_p50_us > 0.0


def test_mistakes(docs, capsys):
    before = (docs / "leaderboard.json").read_bytes()
    assert renew(docs, "broydne") == 2
    assert "'broydne'. Did you mean 'broyden'?" in capsys.readouterr().err
    assert main(["--renew", "broyden", "--write", str(docs)]) == 2
    assert "--renew: expected --out, where the rows go, and --write" in capsys.readouterr().err
    assert main(["--renew", "broyden", "--pages", "foresight", "--out", "out", "--write", str(docs)]) == 2
    assert "--renew: expected some of leaderboard, leaderboard-skew in --pages." in capsys.readouterr().err
    assert (docs / "leaderboard.json").read_bytes() == before
