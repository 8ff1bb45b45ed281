"""Rows, tables, logs and pages of scenarios with collisions and without."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.evaluate import evaluate
from baselines.evaluation import report
from baselines.evaluation.html.series import BUDGET, thin
from baselines.evaluation.log import trajectory_log
from baselines.evaluation.summary import rank, summarise
from baselines.evaluation.table import markdown
from ikgym.obstacles.solids import closest
from tests.baselines.evaluation.html.test_series import decoded
from tests.bodied import blocked, crowd

COLUMNS = ("clearance_min", "closest_pair", "closest_step", "stopped")


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """One that is stopped, one that is not, and one that nothing can stop; with the folder."""
    folder = tmp_path_factory.mktemp("contacts")
    scenarios = blocked(), crowd(), ikgym.scenarios.get("panda-circle").replace(steps=30)
    return evaluate(scenarios, "dls", out=folder), folder


@pytest.fixture(scope="module")
def log():
    scenario = crowd()
    return scenario, trajectory_log(rollout(scenario, baselines.make("dls", scenario), 0))


def test_a_row_has_the_step_of_the_stop_and_what_touched(rows):
    row, scenario = rows[0][0], blocked()
    env = gym.make("RedundantIK-v0", scenario=scenario)
    seen, _ = env.reset(seed=0)
    policy, infos = baselines.make("dls", scenario), [{"collision": False}]
    while not infos[-1]["collision"]:
        seen, *_, info = env.step(policy.predict(seen)[0])
        infos.append(info)
    assert row.stopped == row.closest_step == len(infos) - 1 < scenario.steps
    assert row.clearance_min == min(info["clearance"] for info in infos[1:]) < 1e-3
    assert row.closest_pair[1] == "post"
    assert row.closest_pair[0] in scenario.arm.bodies.names
    assert row.position_error_max > 0.01


def test_a_row_has_the_smallest_clearance_where_nothing_stops(rows):
    row, scenario = rows[0][1], crowd()
    q = baselines.track(scenario, "dls").q
    found = closest(scenario.arm, q, scenario.obstacle_rows(61)[1:], scenario.surroundings.checked)
    assert row.stopped is None
    assert row.clearance_min == pytest.approx(found.distances.min(), abs=1e-12)
    assert row.closest_step == found.distances.argmin() + 1


def test_tables_state_stops_where_there_can_be_any(rows):
    stopped, clear, free = rows[0]
    assert summarise(rows[0]).stopped.fillna(-1).tolist() == [1, 0, -1]
    text = report.table(summarise([stopped, clear]))
    assert "clearance" in text
    assert "stopped: episodes in which they would have met" in " ".join(text.split())
    assert "stopped" not in report.table(summarise([free]))
    both = rank([stopped, clear])
    assert both.stopped_percent.tolist() == [100.0, 0.0]
    assert both.clearance_mm[1] == 1e3 * clear.clearance_min
    assert "stopped [%]" in markdown(both)
    assert "stopped_percent" not in rank([free])


def test_a_log_has_solids_and_closest_points(log):
    scenario, found = log
    n, bodies = scenario.joints, len(scenario.arm.bodies)
    assert found["solids"].shape == (bodies + 4, 16)
    assert found["carriers"].tolist() == [*scenario.arm.bodies.links, n + 1, n + 1, n + 2, n + 1]
    gap = np.linalg.norm(found["closest"][:, 0] - found["closest"][:, 1], axis=1)
    np.testing.assert_allclose(gap, found["clearance"][found["frame"]], atol=1e-6)
    ball = scenario.obstacle_rows(61)[1:, 2, 9:12]
    np.testing.assert_allclose(found["carrier_frames"][:, n + 2, 9:], ball[found["frame"]], atol=1e-6)


def test_a_series_has_surfaces_in_the_frames_that_carry_them(log):
    scenario, found = log
    series = thin(found, BUDGET)
    arrays = {name: decoded(values) for name, values in series["arrays"].items()}
    surface, triangles = arrays["surface"], arrays["triangles"].astype(int)
    assert triangles.max() == len(surface) - 1
    carriers = surface[triangles[:, 0], 3]
    assert (carriers[: series["of_bodies"]] <= scenario.joints).all()
    assert (carriers[series["of_bodies"] :] > scenario.joints).all()
    ball = surface[surface[:, 3] == scenario.joints + 2, :3]
    np.testing.assert_allclose(np.linalg.norm(ball, axis=1), 0.09, rtol=1e-6)
    assert arrays["frames"].shape == (len(arrays["time"]), 12 * 10)
    few = decoded(thin(found, 1)["arrays"]["clearance"])
    assert few.min() == np.float32(found["clearance"].min())
    usual = {key: values for key, values in found.items() if key != "carrier_frames"}
    assert not {"surface", "clearance"} & thin(usual, BUDGET)["arrays"].keys()
