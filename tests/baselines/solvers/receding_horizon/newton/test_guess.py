"""Initial guesses: how long they drift."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.solvers.receding_horizon.newton.guess import DAMPING, initial_guess
from tests.baselines.solvers.receding_horizon.newton.problems import place

AT = (1, 2, 4, 7, 11, 16)
DRIFT = np.array([3.0, -2.0, 1.0, 2.0, -3.0, 1.0, 2.0])


def guess(until, drift=DRIFT, first=0, path=None):
    around = place("varga7", "pose", at=AT, limits=False)
    path = np.empty((len(AT), 7)) if path is None else path.copy()
    initial_guess(around.problem, first, until, drift, DAMPING, path, around.workspace.knot)
    return path


@pytest.mark.parametrize("until", range(len(AT) + 1))
def test_a_guess_drifts_up_to_a_knot_and_then_no_more(until):
    drifting, still, path = guess(len(AT)), guess(len(AT), np.zeros(7)), guess(until)
    assert np.array_equal(path[:until], drifting[:until])
    assert np.array_equal(path[until:], guess(len(AT), np.zeros(7), until, path)[until:])
    if 0 < until < len(AT):
        assert not np.allclose(path[until:], drifting[until:], atol=1e-4)
        assert not np.allclose(path[until:], still[until:], atol=1e-4)
