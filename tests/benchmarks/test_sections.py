"""The benchmarks measure what they say; their times are not tested."""

import itertools

import numpy as np
import pytest

import baselines
import ikgym
from baselines.policy import Problem
from benchmarks import bodies, environments, horizon_solvers, horizons, loop, measuring, policies, poses, resets
from benchmarks.rivals.numpy_horizon import Horizon, plan_cost


def test_medians_are_of_what_was_called():
    counts = {"a": 0, "b": 0}

    def count(name):
        counts[name] += 1

    times = measuring.medians({name: lambda name=name: count(name) for name in counts}, rounds=3, seconds=1e-5)
    assert set(times) == set(counts)
    assert all(t > 0 for t in times.values())
    assert all(n > 3 for n in counts.values())


def test_a_turn_is_at_least_one_call():
    made = []
    measuring.medians({"a": lambda: made.append(1)}, rounds=4, seconds=0.0)
    assert len(made) == 1 + 1 + 4


def test_environments_step():
    for calls, skipped in (environments.single(), environments.vector(3)):
        assert len(calls) >= 3
        assert all(isinstance(why, str) for why in skipped)
        for call in calls.values():
            call()


def test_resets_are_timed_for_each_id():
    (table,) = resets.tables(measuring.QUICK)
    assert list(table.rows) == list(ikgym.rl.IDS)
    assert all(value > 0.0 for (value,) in table.rows.values())


@pytest.mark.filterwarnings("ignore:.* does not keep")  # the machine may be busy
def test_the_loop_is_timed_beside_its_policy(monkeypatch):
    monkeypatch.setattr(loop, "LOOPS", {name: loop.LOOPS[name] for name in list(loop.LOOPS)[2::3]})
    (table,) = loop.tables(measuring.QUICK)
    assert all(step > 0.0 and 0.0 < predict < 1e9 for predict, step, *_ in table.rows.values())
    assert len(table.rows) == 2


def test_both_kinematics_are_of_the_same_arm():
    import pinocchio as pin

    arm = ikgym.arms.get("varga7")
    model, frame = poses.pinocchio_model(arm)
    q = np.random.default_rng(0).uniform(-1, 1, 7)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    np.testing.assert_allclose(data.oMf[frame].translation, arm.forward(q)[1], atol=1e-12)
    for call, _ in poses.kinematics().values():
        call()


def test_coal_measures_the_same_bodies():
    arm, obstacles = ikgym.arms.get(bodies.ARM), bodies.ten_boxes()
    q = bodies.postures(arm, 20)
    measure, found = bodies.with_coal(arm, obstacles)
    for row, distance in zip(q, arm.clearance(q, obstacles)[0], strict=True):
        measure(row)
        assert min(one.min_distance for one in found.distanceResults) == pytest.approx(distance, abs=1e-9)
    (table,) = bodies.tables(measuring.QUICK)
    assert len(table.rows) == 4


def test_libraries_are_timed_beside_their_policies():
    (with_libraries,) = (one for one in policies.tables(measuring.QUICK) if one.columns[-1] == "library [µs]")
    times = {name: (row[0], row[-1]) for name, row in with_libraries.rows.items()}
    assert times["qp"][1] is None
    assert all(times[name][1] > 0.0 for name in ("pink", "mink"))


def test_policies_are_those_of_their_scenarios():
    for scenario, labelled in policies.POLICIES.items():
        for name, parameters in labelled.values():
            assert baselines.make(name, scenario, **parameters).name == name


def test_states_lead_to_one_another():
    scenario = ikgym.scenarios.get("varga7-fast").replace(steps=30)
    for seen in horizons.along(scenario, preview=4, count=2, lead=3):
        assert len(seen) == 4
        for before, after in itertools.pairwise(seen):
            assert before["remaining"] - after["remaining"] == 1
            np.testing.assert_allclose(before["q"] + scenario.dt * after["qdot"], after["q"], atol=1e-12)
            np.testing.assert_array_equal(before["nominal"][1:], after["nominal"][:-1])


def test_costs_of_solvers_are_those_of_their_plans():
    scenario = ikgym.scenarios.get("varga7-slow")
    (seen,) = horizons.along(scenario, preview=4, count=1, lead=2)
    others, _ = horizon_solvers.rivals(scenario, 5)
    costs = {}
    for label, solver in (horizon_solvers.policies(scenario, 5) | others).items():
        call, answer = solver.warmed(seen)
        found = answer(call())
        assert found.q.shape == (4, 7)
        horizon = Horizon(seen[-1]["q"], seen[-1]["nominal"])
        assert found.cost == pytest.approx(plan_cost(Problem.of(scenario), horizon, found.q))
        assert found.iterations >= 1
        costs[label] = found.cost
    assert min(costs.values()) == pytest.approx(costs["CasADi, IPOPT"], rel=1e-4)
    assert costs["rhc_gradient, analytic"] > costs["CasADi, IPOPT"]


def test_what_is_not_installed_is_named(monkeypatch):
    monkeypatch.setitem(horizon_solvers.RIVALS, "Somebody", ("no_such_module", "Nobody", {}))
    found, skipped = horizon_solvers.rivals(ikgym.scenarios.get("varga7-slow"), 3)
    assert "Somebody" not in found
    assert any(why.startswith("Somebody") and "ikgym[rivals]" in why for why in skipped)
