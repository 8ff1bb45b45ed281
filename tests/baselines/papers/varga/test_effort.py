"""Which readings Varga's claims on the descent are tested in."""

from __future__ import annotations

import types

import numpy as np
import pytest

from baselines.papers.varga import effort
from baselines.status import Status


class Played:
    """Runs whose episodes are made up: some readings blow up, or reach the limit."""

    def __init__(self, bad):
        self.bad, self.asked = bad, set()

    def play(self, scenario, policy, /, **parameters):
        key = scenario, parameters.get("alpha_start", "restart"), parameters.get("warm_start", "unshifted")
        self.asked.add(key)
        bad = key in self.bad
        one = np.ones(10)
        return types.SimpleNamespace(
            status=np.full(10, int(Status.DIVERGED if bad else Status.CONVERGED)),
            iterations=np.full(10, 450 if bad else 58),
            tracking_cost=one,
            velocity_cost=one,
            position_error=one,
            time_ns=1000 * one,
        )


ALL = {
    (scenario, alpha, warm)
    for scenario in ("varga7-fast", "varga7-literal-fast")
    for alpha in ("restart", "kept")
    for warm in ("unshifted", "shifted")
}
ONE = {("varga7-fast", "restart", "shifted")}


@pytest.mark.parametrize(("bad", "wanted"), [(set(), "reproduced"), (ONE, "depends"), (ALL, "contradicted")])
def test_the_printed_step_is_tested_in_all_readings(bad, wanted):
    runs = Played(bad)
    finding = effort.printed_step(runs)
    assert runs.asked == ALL
    assert finding.verdict == wanted
    for scenario, alpha, warm in ALL:
        share = 100 * ((scenario, alpha, warm) in bad)
        assert f"`{scenario}`, {alpha}, {warm}: {share} %" in finding.evidence


@pytest.mark.parametrize(("bad", "wanted"), [(set(), "contradicted"), (ONE, "depends"), (ALL, "reproduced")])
def test_the_limit_is_tested_in_all_readings(bad, wanted):
    runs = Played(bad)
    assert effort.limit_reached(runs).verdict == wanted
    assert runs.asked == ALL


@pytest.mark.parametrize(("late", "wanted"), [(1.0, "reproduced"), (1.3, "contradicted"), (0.7, "contradicted")])
def test_time_is_proportional_if_a_gradient_takes_the_same_in_long_calls(late, wanted):
    iterations = np.arange(50, 150)
    time_ns = 1e4 * (iterations + 1) * np.where(iterations > 120, late, 1.0)
    runs = types.SimpleNamespace(play=lambda *_, **__: types.SimpleNamespace(iterations=iterations, time_ns=time_ns))
    assert effort.time_proportional(runs).verdict == wanted
