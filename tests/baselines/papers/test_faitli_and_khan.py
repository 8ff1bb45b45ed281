"""Faitli and Khan: yanks near the shoulder axis, which both speak of, one threshold for like claims, and conditions."""

import pathlib
import re
import types

import numpy as np
import pytest

from baselines.papers.khan import claims as khan
from baselines.papers.khan.episodes import CLOSED_LOOPS, METHOD, Errors
from baselines.papers.runs import Runs
from baselines.solvers import fixed_point, resolved_rate


def test_both_methods_do_without_factorisations():
    """The claims on this count operations by hand."""
    decomposed = {
        package.__name__: sum(
            re.search(r"\b(linalg|cholesky|ldl|inv|pinv|qr|svd|factorise)\b", file.read_text()) is not None
            for file in pathlib.Path(package.__path__[0]).glob("*.py")
        )
        for package in (fixed_point, resolved_rate)
    }
    assert decomposed[fixed_point.__name__] == 0 < decomposed[resolved_rate.__name__]


@pytest.mark.parametrize("growth", [0.05, 0.27])
@pytest.mark.parametrize(("largest", "visible"), [(9.0, True), (1e-9, False)])
def test_a_degraded_error_has_not_remained(monkeypatch, growth, largest, visible):
    """An error of 9 m is visible on this path, and one of 1 nm is not."""
    before = Errors(0.04, 0.1, largest, 0.2)
    after = Errors(*((1.0 + growth) * error for error in before))
    monkeypatch.setattr(khan, "_errors_with_weights", lambda *_: (before, after))
    degraded, runs = growth > 0.1, Runs(steps=60)
    for claim in (khan.f_weights_orientation_down, khan.f_couples, khan.w_degrades_q7_and_q8):
        assert claim(runs).verdict == ("reproduced" if degraded else "contradicted")
    assert khan.w_keeps_precision(runs).holds == {
        "against the run without W": not degraded,
        "against the extent": not visible,
    }


@pytest.mark.parametrize(
    ("probing", "wanted"),
    [((), "depends"), (CLOSED_LOOPS, "reproduced"), (CLOSED_LOOPS[:1], "depends"), ((METHOD,), "contradicted")],
)
def test_an_exploration_is_seen_in_the_motion(probing, wanted):
    """One step for each joint in turn, the others at rest, between steps of all."""

    def play(_path, policy):
        qdot = np.ones((20, 8))
        if policy in probing:
            qdot[4:12] = np.eye(8)
        return types.SimpleNamespace(qdot=qdot)

    found = khan.no_exploration(types.SimpleNamespace(play=play))
    assert found.verdict == wanted
    assert [name.removesuffix(" [%]") for name, share in found.figures.items() if share == 40.0] == list(probing)
