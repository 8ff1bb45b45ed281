"""The benchmarks measure what they say, and the report has all of it; times are not tested."""

import itertools
import math

import numpy as np
import pinocchio as pin
import pytest

import ikgym
from baselines.policy import Problem
from benchmarks import horizons, measuring, pose_solvers, poses
from benchmarks.__main__ import SECTIONS, Command, main
from benchmarks.rivals.numpy_horizon import Horizon, plan_cost
from benchmarks.table import Table, page

PANDA = ikgym.arms.get("panda")


@pytest.mark.filterwarnings("ignore:.* does not keep")  # the machine may be busy
def test_quick_report_is_complete(tmp_path, capsys):
    tables = main(Command(tmp_path, quick=True))
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    printed = capsys.readouterr().out
    assert len({table.title for table in tables}) == len(tables) >= len(SECTIONS)
    for found in tables:
        assert found.markdown() in text
        assert found.markdown() in printed
        united = [k for k, column in enumerate(found.columns) if "[" in column]
        for row in found.rows.values():
            assert all(math.isfinite(row[k]) and row[k] > 0 for k in united if row[k] is not None)
        if found.columns == horizons.COLUMNS:  # no solver is below the best of them
            assert min(row[-1] for row in found.rows.values()) == 0.0
        if found.title.startswith("Inverse"):
            assert len(found.rows) + len(found.skipped) == len(pose_solvers.OURS) + len(pose_solvers.RIVALS)
        if found.columns[-1] == "library [µs]":
            assert all((name in ("pink", "mink")) == bool(row[-1]) for name, row in found.rows.items())


def test_tables_are_markdown():
    rows = {"first": (12.3456, 1.0), "second": (2.0e6, None)}
    table = Table("Speed", "On a quiet day.", ("step [µs]", "× first"), rows, ("third: it is not there",))
    assert table.markdown().splitlines()[4:] == [
        "|  | step [µs] | × first |",
        "| :-- | --: | --: |",
        "| first | 12.35 | 1.000 |",
        "| second | 2.000e6 | – |",
        "",
        "- left out: third: it is not there",
    ]
    text = page([table], {"command": "mine"})
    assert "\n- command: mine\n" in text
    assert "\n- gymnasium: 1." in text


def test_unknown_sections_are_refused(tmp_path):
    with pytest.raises(SystemExit, match=r"expected some of .*horizons.*, got nonsense"):
        main(Command(tmp_path, quick=True, sections=("nonsense",)))


@pytest.mark.parametrize(("seconds", "least"), [(0.0, 1 + 1 + 3), (1e-5, 6)])
def test_medians_are_of_the_calls(seconds, least):
    """One before anything is timed, one that is, and a turn is at least one call."""
    made = []
    times = measuring.medians({name: lambda name=name: made.append(name) for name in "ab"}, rounds=3, seconds=seconds)
    assert all(times[name] > 0 and made.count(name) >= least for name in "ab")


def test_both_kinematics_are_of_the_same_arm():
    arm = ikgym.arms.get("varga7")
    model, frame = poses.pinocchio_model(arm)
    q, data = np.random.default_rng(0).uniform(-1, 1, 7), model.createData()
    pin.framesForwardKinematics(model, data, q)
    np.testing.assert_allclose(data.oMf[frame].translation, arm.forward(q)[1], atol=1e-12)


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
    costs = {}
    for label, (call, plan) in horizons.solvers(scenario, 5, seen).items():
        q, costs[label] = plan(call())
        assert q.shape == (4, 7)
        horizon = Horizon(seen[-1]["q"], seen[-1]["nominal"])
        assert costs[label] == pytest.approx(plan_cost(Problem.of(scenario), horizon, q))
    assert min(costs.values()) == pytest.approx(costs[horizons.IPOPT], rel=1e-4)
    assert costs["rhc_gradient, analytic"] > costs[horizons.IPOPT]


def test_postures_that_miss_their_poses_do_not_count():
    drawn = poses.random_poses(PANDA, 4)
    q = PANDA.inverse(drawn[:, :3, :3], drawn[:, :3, 3])[0]
    np.testing.assert_array_equal(poses.met(PANDA, drawn, q), [True] * 4)
    q[0, 0] += 1e-3
    q[1] = np.nan
    q[2, 3] += 2 * np.pi  # the same pose, outside the limits
    np.testing.assert_array_equal(poses.met(PANDA, drawn, q), [False, False, False, True])
    solve = pose_solvers.together(PANDA)
    half = lambda given: np.where(given[:, :1, 3] > np.median(drawn[:, 0, 3]), solve(given), np.nan)  # noqa: E731
    found = poses.measured(PANDA, {"half": half, "all": solve}, drawn)
    assert [share for share, _ in found.values()] == [0.5, 1.0]
    assert all(seconds > 0.0 for _, seconds in found.values())


@pytest.mark.parametrize("label", [*pose_solvers.OURS, *pose_solvers.RIVALS])
@pytest.mark.parametrize("name", poses.ARMS)
def test_every_solver_meets_poses_of_the_very_arm(name, label):
    arm = ikgym.arms.get(name)
    try:
        solve = {**pose_solvers.OURS, **pose_solvers.RIVALS}[label](arm)
    except ImportError:
        pytest.skip("pip install ikgym[rivals]")
    drawn = poses.random_poses(arm, 5)
    assert poses.met(arm, drawn, solve(drawn)).mean() >= 0.8
