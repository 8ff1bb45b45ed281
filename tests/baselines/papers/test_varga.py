"""Varga: the readings in which claims on the descent are tested, and times."""

import itertools
import time
import types

import numpy as np
import pytest

import baselines
import ikgym
from baselines.papers.runs import Runs
from baselines.papers.varga import claims
from baselines.papers.varga.episodes import time_of_step
from baselines.papers.varga.interpreted import descend
from baselines.status import Status


class MadeUp:
    """Runs with made-up episodes, which diverge or reach the limit in some readings."""

    def __init__(self, bad):
        self.bad, self.played = bad, set()

    def play(self, scenario, policy, /, **parameters):
        key = scenario, parameters.get("alpha_start", "restart"), parameters.get("warm_start", "unshifted")
        self.played.add(key)
        return types.SimpleNamespace(
            status=np.full(10, int(Status.DIVERGED if key in self.bad else Status.CONVERGED)),
            iterations=np.full(10, 450 if key in self.bad else 58),
        )


ALL = {
    (scenario, alpha, warm)
    for scenario in ("varga7-fast", "varga7-literal-fast")
    for alpha in ("restart", "kept")
    for warm in ("unshifted", "shifted")
}
ONE = {("varga7-fast", "restart", "shifted")}


@pytest.mark.parametrize(
    ("bad", "printed", "limit"),
    [(set(), "reproduced", "contradicted"), (ONE, "depends", "depends"), (ALL, "contradicted", "reproduced")],
)
def test_the_descent_is_tested_in_all_readings(bad, printed, limit):
    for claim, wanted in ((claims.printed_step, printed), (claims.limit_reached, limit)):
        runs = MadeUp(bad)
        finding = claim(runs)
        assert runs.played == ALL
        assert finding.verdict == wanted
        assert sorted(np.ravel(list(finding.figures.values()))) == [0.0] * (8 - len(bad)) + [100.0] * len(bad)


@pytest.mark.parametrize(("overhead", "wanted"), [(0.0, "reproduced"), (50.0, "contradicted")])
def test_times_are_compared_from_50_to_450_iterations(monkeypatch, overhead, wanted):
    """Proportional times, and times with an overhead of 50 iterations, twice as long at 50 as proportional ones."""
    asked = []

    def time_of_step(_runs, tolerance, iterations):
        asked.append((tolerance, iterations))
        return 1e-5 * (iterations + overhead)

    monkeypatch.setattr(claims, "time_of_step", time_of_step)
    assert claims.time_proportional(Runs()).verdict == wanted
    assert asked == [(0.0, iterations) for iterations in (50, 150, 250, 350, 450)]


def test_the_time_of_a_step_is_that_of_the_processor(monkeypatch):
    """Each reading of a clock that is replaced is 1 ms later."""
    clock = itertools.count()
    monkeypatch.setattr(time, "thread_time", lambda: 1e-3 * next(clock))
    assert time_of_step(Runs(steps=5), iterations=50) == pytest.approx(1e-3)
    assert next(clock) == 10


def test_the_interpreted_descent_is_that_of_rhc_gradient():
    scenario = ikgym.scenarios.get("varga7-fast")
    q, nominal = scenario.nominal_joint_path()[200], scenario.nominal()[201:203]
    policy = baselines.make("rhc_gradient", scenario, tolerance=0.0, iterations=60)
    observation, _ = ikgym.RedundantIKEnv(scenario, preview=2).reset(options={"q": q})
    _, state = policy.predict({**observation, "nominal": nominal})
    plan = state[2][0]
    assert 0.1 < abs(plan).max() < 20.0
    np.testing.assert_allclose(descend(scenario, q, nominal, 60), plan, rtol=1e-6, atol=1e-9)
