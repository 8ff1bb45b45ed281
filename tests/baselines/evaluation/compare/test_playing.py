"""Solvers on three paths; two of them, so that it takes little time."""

import time

import pytest

import ikgym
from baselines.evaluation import report
from baselines.evaluation.compare import playing, rule
from baselines.evaluation.compare.playing import compare
from baselines.paths.survey import RESERVE
from baselines.solvers.rivals.base import Rival


def test_a_path_out_of_reach_has_no_solver(monkeypatch):
    monkeypatch.setattr(playing, "PREFERRED", ("qp", "dls"))
    found = compare(ikgym.scenarios.get("panda-edge").replace(dt=0.01, steps=300))
    assert found.recommendation.solver is None
    assert found.notes[0].startswith("not retimed: ")
    assert [(row.scenario, playing.solver_of(row)) for row in found.rows] == [
        (path, solver) for path in (playing.AS_IT_IS, playing.LATE) for solver in ("qp", "dls")
    ]
    text = found.table(80)
    assert "Recommended: none of these solvers. No solver follows the path: qp errs by" in text
    assert " ".join(text.split()).count(rule.RULE) == 1
    assert playing.LIBRARY not in text
    assert max(len(line.replace("\u0307", "")) for line in text.splitlines()) <= 80
    assert {"q̈", "stop", "follows"} <= set(text.splitlines()[0].split())


def test_what_is_left_out_is_named(monkeypatch):
    def missing(scenario, reserve):
        assert reserve == RESERVE
        raise ModuleNotFoundError("No module named 'toppra'")

    monkeypatch.setattr(playing, "PREFERRED", ("qp", "pink"))
    monkeypatch.setattr(playing, "retime", missing)
    found = compare(ikgym.scenarios.get("varga7-slow").replace(steps=20))
    unlimited, retimed, rival = found.notes
    assert unlimited == f"{report.STATED_NOTE}; --acceleration states limits"
    assert retimed == "not retimed: No module named 'toppra'"
    assert rival.startswith("left out: pink: ")
    assert {row.policy for row in found.rows} == {"qp", "predicted"}


def test_times_of_a_library_are_those_of_its_own_calls(monkeypatch):
    """A conversion that takes 20 ms does not count."""
    pytest.importorskip("mink")
    monkeypatch.setattr(playing, "PREFERRED", ("dls", "mink"))
    monkeypatch.setattr(playing, "STEPS", 5)
    target = Rival.target

    def slow(policy, *observed):
        time.sleep(0.02)
        return target(policy, *observed)

    monkeypatch.setattr(Rival, "target", slow)
    found = compare(ikgym.scenarios.get("panda-circle").replace(steps=6))
    times = {row.policy: row.time_p50_us for row in found.rows if row.scenario == playing.AS_IT_IS}
    assert times["mink"] < 15e3
    assert " ".join(playing.LIBRARY.split()) in " ".join(found.table(80).split())
