"""Zhang: the tools of the claims; that these come out is tested with the ledger."""

import numpy as np
import pytest

from baselines.papers.runs import Runs
from baselines.papers.zhang import claims, predictive
from baselines.papers.zhang.episodes import SHARES, TARGETS, at_rest, draw_targets
from baselines.registry import make
from baselines.status import Status


@pytest.fixture(scope="module")
def trial():
    return Runs(200)


@pytest.mark.parametrize("name", TARGETS)
def test_targets_with_a_converged_solution_are_met(trial, name):
    targets = draw_targets(trial, name)
    assert len(targets.q) == 200
    q, status = targets.solve(make("mfac", targets.scenario))
    met = status == Status.CONVERGED
    assert met.mean() > 0.9
    assert np.linalg.norm(targets.error(q), axis=1)[met].max() <= 1e-9
    if TARGETS[name][2] is not None:  # a target where J has lost rank
        assert np.median(np.linalg.cond(targets.jacobian(q[met]))) > 1e4


def test_mfac_is_levenberg_marquardt_and_another_damping_is_not(trial, monkeypatch):
    assert claims.levenberg_marquardt(trial).verdict == "reproduced"
    steps = claims.sugihara
    monkeypatch.setattr(claims, "sugihara", lambda targets, damping: steps(targets, 1.01 * damping))
    assert claims.levenberg_marquardt(trial).verdict == "contradicted"


def test_damping_tolerates_a_wrong_model(trial):
    """Links of 45 % make the gain of λ = 0 more than 2, the limit of stability."""

    def lost(share, links):
        return (at_rest(trial, share, 0.1, links=links)[0][-1] >= 0.01).mean()

    assert lost(0.0, 0.45) == 1.0
    assert lost(SHARES[-1], 0.45) < 0.5
    assert lost(0.0, 0.55) == 0.0


def test_an_inverse_of_18_rows_is_fast_enough_where_it_is_compiled():
    """The ledger leaves claims on times out; this one is far from its bounds on any machine."""
    assert predictive.inverse_of_18(Runs()).verdict == "depends"
