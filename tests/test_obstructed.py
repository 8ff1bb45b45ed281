"""CppFlow's rule: passed where all of it holds."""

import numpy as np
import pytest

from baselines.evaluation.table import to_csv
from docs import keeping, obstructed
from docs.obstructed import verdict
from ikgym import problems, scenarios


def test_an_exact_path_passes_and_each_fault_fails():
    scenario = scenarios.get("cppflow-fetch_arm-hello")
    nominal = scenario.nominal()[::10]
    q = [scenario.start_of()]
    for row in nominal[1:]:
        q.append(scenario.arm.inverse(row[:9].reshape(3, 3), row[9:], start=q[-1], restarts=0)[0])
    q = np.array(q)
    exact = verdict(scenario, q)
    assert exact.followed
    assert exact.position < 1.5e-5
    assert exact.passed == (exact.turn < np.radians(7.0) and exact.clearance > 0.0)
    moved = q.copy()
    moved[5, 1] += 1e-3
    assert not verdict(scenario, moved).followed
    beyond = q.copy()
    beyond[5, 0] = scenario.arm.upper[0] + 0.1
    assert not verdict(scenario, beyond).within
    np.testing.assert_allclose(verdict(scenario, beyond).turn, np.abs(np.diff(beyond[:, 0])).max())


def test_a_full_turn_of_a_joint_without_limits_is_no_motion():
    name = "rlitg-random-041"
    joints = problems.get(name).trajectories["cloning"]
    assert np.abs(np.diff(joints, axis=0)).max() > 6.0
    assert verdict(scenarios.get(name), joints).turn < 1.0


@pytest.mark.slow
def test_no_published_trajectory_passes():
    """The figures of docs/bodies.md."""
    paths = [(name, q) for name in problems.OBSTRUCTED for q in problems.get(name).trajectories.values()]
    judged = [verdict(scenarios.get(name), q) for name, q in paths]
    assert len(judged) == 102
    assert not any(one.passed or one.followed for one in judged)


def test_the_table_of_the_page_sums_up_its_problems():
    lines = keeping.lines(obstructed.PATHS)
    assert [line["problem"] for line in lines] == list(problems.OBSTRUCTED)
    assert to_csv(obstructed.table(lines)) == (keeping.RESULTS / "obstructed.csv").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_problem_of_the_table_is_measured_anew():
    name = "cppflow-panda-2cubes"
    [line] = [one for one in keeping.lines(obstructed.PATHS) if one["problem"] == name]
    measured = obstructed.line(name)
    assert {key: str(measured[key]) for key in line if not key.startswith("qp_")} == {
        key: value for key, value in line.items() if not key.startswith("qp_")
    }
