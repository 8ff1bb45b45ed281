"""Solvers on three paths; two of them, so that it takes little time."""

import ikgym
from baselines.evaluation import report
from baselines.evaluation.compare import playing
from baselines.evaluation.compare.playing import compare


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
    assert max(len(line.replace("\u0307", "")) for line in text.splitlines()) <= 80
    assert {"q̈", "stop", "follows"} <= set(text.splitlines()[0].split())


def test_what_is_left_out_is_named(monkeypatch):
    def missing(scenario):
        raise ModuleNotFoundError("No module named 'toppra'")

    monkeypatch.setattr(playing, "PREFERRED", ("qp", "pink"))
    monkeypatch.setattr(playing, "retime", missing)
    found = compare(ikgym.scenarios.get("varga7-slow").replace(steps=20))
    unlimited, retimed, rival = found.notes
    assert unlimited == f"{report.STATED_NOTE}; --acceleration states limits"
    assert retimed == "not retimed: No module named 'toppra'"
    assert rival.startswith("left out: pink: ")
    assert {row.policy for row in found.rows} == {"qp", "predicted"}
