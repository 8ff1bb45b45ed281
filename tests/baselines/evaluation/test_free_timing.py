"""Policies with free timing in the table: time and error along the path, and the costs on the clock."""

import csv
import json

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import Seeds, add_up
from baselines.evaluate import evaluate
from baselines.evaluation import report
from baselines.evaluation.columns import COLUMNS
from baselines.evaluation.motion.free_timing import reference_at
from baselines.evaluation.motion.spline import FEWEST
from baselines.evaluation.summary import rank, summarise
from baselines.evaluation.table import records
from tests.baselines.solvers.quadratic_program.paths import circle


def too_fast(**changes):
    return circle(speed=2.5, acceleration=100.0, **changes)


def row(scenario, policy="qp_path", **options):
    (one,) = evaluate(scenario, policy, **options)
    return one


@pytest.mark.parametrize("task", ["axis", "position", "matrix"])
def test_the_row_has_the_time_and_the_error_along_the_path(task):
    scenario = too_fast(task=ikgym.tasks.get(task))
    one = row(scenario)
    assert one.steps == scenario.steps
    assert 1.5 * scenario.steps < one.path_time / scenario.dt < 4 * scenario.steps
    assert one.path_position_error < 5e-5 < 1e-2 < one.position_error_max
    assert (one.path_orientation_error is None) == (task != "axis")
    assert (one.path_orientation_error or 0.0) < 1e-4


def test_the_error_is_the_distance_from_the_path_itself():
    """Against the tool of the played joint motion, and the circle that it is to follow; costs are on the clock."""
    scenario, spec = too_fast(), "qp_path:longest_lateness=0.1"
    played = baselines.track(scenario, spec)
    tool = scenario.arm.forward(played.q)[1]
    centre = scenario.arm.forward(scenario.arm.home)[1] - [0.05, 0.0, 0.0]
    distance = np.hypot(np.linalg.norm((tool - centre)[:, :2], axis=1) - 0.05, tool[:, 2] - centre[2])
    one = row(scenario, spec)
    assert 1e-3 < distance.max() <= one.path_position_error  # which has what is missing along the path, too
    on_the_clock = played.cost[: scenario.steps]
    assert one.total_cost == add_up(on_the_clock)
    assert sum(one.status_counts.values()) == scenario.steps
    assert one.position_error_max == played.position_error[: scenario.steps].max()


def test_the_time_is_that_of_the_path_or_none_if_its_end_is_not_reached():
    scenario = circle()
    assert row(scenario).path_time == pytest.approx(scenario.steps * scenario.dt, rel=1e-9)
    scenario = too_fast()
    one = row(scenario.replace(arm=scenario.arm.replace(velocity_limit=0.05 * scenario.arm.velocity_limit)))
    assert one.path_time is None
    assert one.path_position_error < 1e-3
    assert COLUMNS["path_time_s"].cells(summarise([one])) == ["–"]


def test_tables_mark_the_kind_and_others_have_no_such_columns():
    scenario = too_fast()
    rows = evaluate(scenario, ["qp", "qp_path"])
    text, plain = report.table(summarise(rows)), report.table(summarise(rows[:1]))
    assert "qp_path ‡" in text
    assert "‡ free timing" in text
    assert "path time" in text
    assert "‡" not in plain
    assert "path" not in plain.split("\n", 1)[1]
    assert rows[0].path_time is None
    qp, free = sorted(records(rank(rows)), key=lambda line: line["policy"])
    assert (np.isnan(qp["path_time_s"]), free["path_time_s"]) == (True, rows[1].path_time)
    assert (qp["path_error_mm"], free["path_error_mm"]) == (
        1e3 * rows[0].position_error_max,
        1e3 * rows[1].path_position_error,
    )
    assert "path_time_s" not in rank(rows[:1])


def test_the_motion_that_is_exported_goes_on_to_the_end_of_the_path(tmp_path):
    scenario = too_fast()
    one = row(scenario, out=tmp_path, export="joint-trajectory", report=False)
    (file,) = (tmp_path / "export").rglob("*.json")
    points = json.loads(file.read_text())["points"]
    steps = round(one.path_time / scenario.dt)
    assert steps < len(points) <= steps + 1 + FEWEST  # with the last bit of a stop
    start, end = (scenario.arm.forward(points[k]["positions"])[1] for k in (0, -1))
    np.testing.assert_allclose(end, start, rtol=0, atol=1e-4)  # a whole turn
    (line,) = csv.DictReader((tmp_path / "results.csv").read_text().splitlines())
    assert float(line["path_time"]) == one.path_time


@pytest.mark.parametrize("name", ["varga7-random", "zhang6-lspb", "panda-circle", "khan8-q1"])
def test_at_whole_steps_the_reference_is_that_of_the_scenario(name):
    scenario = ikgym.scenarios.get(name).replace(steps=40)
    there = reference_at(scenario, Seeds(3), np.arange(41.0))
    np.testing.assert_allclose(there, scenario.nominal(3), rtol=0, atol=1e-12)


def test_wrappers_pass_it_on():
    scenario = too_fast()
    assert baselines.make("offset_free", scenario, policy="qp_path").free_timing
    assert not baselines.make("offset_free", scenario, policy="qp").free_timing
