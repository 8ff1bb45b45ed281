import dataclasses
import datetime
import pathlib
import re

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import Seeds, rollout
from baselines.evaluate import evaluate
from baselines.evaluation import report
from baselines.evaluation.jobs import Skipped
from baselines.evaluation.metrics import Row
from baselines.evaluation.plots import bands, cost_time, joints, style, tracking
from baselines.evaluation.summary import summarise
from baselines.evaluation.trajectory_log import trajectory_log
from baselines.files import ResultsError
from tests.baselines.making import circle

BASE = Row(
    scenario="varga7-fast",
    policy="dls",
    parameters={"gain": 1.0, "damping": 1e-3},
    seed=0,
    steps=3000,
    total_cost=1.423456e7,
    tracking_cost=301.25,
    velocity_cost=1.4234e7,
    cost_ratio=None,
    position_error_max=1.416e-3,
    position_error_rms=1e-4,
    orientation_error_max=0.01688,
    orientation_error_rms=1e-3,
    qdot_peak=13.3125,
    qdot_rms=2.0,
    qdot_total_variation=100.0,
    qddot_peak=500.0,
    steps_at_joint_limit=0,
    steps_at_velocity_limit=0,
    steps_at_acceleration_limit=0,
    joint_limit_margin_min=None,
    time_p50_us=16.21,
    time_p99_us=28.79,
    deadline_misses=1,
    status="converged",
    machine={"cpu": "A | B", "cores": 2, "ikgym": "0.1.0"},
    iterations=1.0,
    status_counts={"converged": 3000},
    preview=1,
    fingerprint="0",
    time_first_us=120.0,
    test_set=None,
)
REFERENCE = dataclasses.replace(BASE, policy="follow_nominal", parameters={}, tracking_cost=0.0)
DATE = datetime.datetime(2026, 1, 2, 3, 4, tzinfo=datetime.UTC)


def row(**changes):
    return dataclasses.replace(BASE, **changes)


@pytest.mark.parametrize(
    ("value", "scale", "text"),
    [
        (1.423456e7, 1.0, "1.423e7"),
        (301.25, 1.0, "301.2"),
        (1234.4, 1.0, "1234"),
        (9999.7, 1.0, "1.000e4"),
        (0.012345, 1e3, "12.35"),
        (4.4821e-10, 1.0, "4.482e-10"),
        (20.0, 1.0, "20.00"),
        (0.0, 1.0, "0"),
        (None, 1.0, "–"),
        (float("nan"), 1.0, "–"),
        (float("inf"), 1.0, "inf"),
    ],
)
def test_numbers_have_four_digits(value, scale, text):
    assert report.number(value, scale) == text


def test_table():
    text = report.table([BASE, REFERENCE])
    lines = text.split("\n")
    assert lines[0] == "varga7-fast: 3000 steps"
    cells = re.split(r"\s{2,}", lines[4])
    assert cells == [
        "dls",
        "1.423e7",
        "301.2",
        "1.423e7",
        "–",
        "1.416",
        "16.88",
        "13.31",
        "16.21",
        "28.79",
        "1",
        "converged",
    ]
    assert lines[5].startswith("follow_nominal *")
    assert "* reference: has privileged information" in text
    assert "[mm]" in lines[2]
    assert "[mrad]" in lines[2]
    assert "episodes" not in text


def test_a_policy_that_ran_into_a_stop_is_marked():
    stopped = row(policy="moore_penrose", parameters={}, steps_at_joint_limit=3)
    text = report.table([BASE, stopped, dataclasses.replace(REFERENCE, steps_at_joint_limit=1)])
    assert [line.split("  ")[0] for line in text.split("\n")[4:7]] == ["dls", "moore_penrose †", "follow_nominal * †"]
    assert report.STOP_NOTE in text
    assert "†" not in report.table([BASE, row(policy="moore_penrose", steps_at_velocity_limit=3)])
    assert summarise([stopped, dataclasses.replace(stopped, seed=1)])[0].steps_at_joint_limit == 6


def test_several_episodes_are_put_together():
    costs = {2_000_000: 10.0, 2_000_001: 1000.0, 2_000_002: 1e6}
    text = report.table([row(scenario="varga7-random", seed=seed, total_cost=cost) for seed, cost in costs.items()])
    assert text.startswith("varga7-random: 3 episodes of 3000 steps")
    assert "total cost over the episodes of varga7-random" in text
    (line,) = (line for line in text.split("\n") if "2000002" in line)
    assert re.split(r"\s{2,}", line) == ["dls", "3", "2154", "1000", "8.002e5", "1.000e6", "2000002", "0"]
    assert "geometric means" in text


def test_several_episodes_are_judged_by_their_cost_ratio_where_it_is_known():
    rows = [
        row(scenario="varga7-random", seed=seed, cost_ratio=cost_ratio, position_error_max=error)
        for seed, cost_ratio, error in ((7, 1.0, 0.0), (8, 4.0, 0.06), (9, 2.0, 0.0))
    ]
    text = report.table(rows)
    assert "cost ratio over the episodes of varga7-random" in text
    assert "total cost over" not in text
    line = [line for line in text.split("\n") if line.startswith("dls")][-1]
    assert re.split(r"\s{2,}", line) == ["dls", "3", "2.000", "2.000", "3.600", "4.000", "8", "1"]
    assert re.split(r"\s{2,}", text.split("\n")[4])[4] == "2.000"
    assert "Cost ratio over the episodes:" in report.readme(rows, command="c", date=DATE)
    assert "total cost over" in report.table([*rows, row(scenario="varga7-random", seed=10)])


def test_lines_fit_the_width():
    wide = {
        "total_cost": 1.2345e-100,
        "tracking_cost": 1.2345e-100,
        "velocity_cost": 1.2345e-10,
        "qdot_peak": 1.2345e-5,
    }
    rows = [
        row(status="iteration_limit", position_error_max=1.2345e-9, orientation_error_max=1.2345e-9, **wide),
        row(policy="rhc_gradient", parameters={"horizon": 50, "alpha_max": 1.2345e-5, "alpha_factor": 1.234}),
        row(policy="follow_nominal", parameters={}),
    ]
    skipped = [Skipped("zhang3-helix", "follow_nominal", "word " * 60)]
    text = report.table(rows, skipped)
    assert max(len(line) for line in text.split("\n")) <= report.WIDTH
    assert "rhc_gradient:horizon=50,alpha_max=1.2345e-05,alpha_factor=1.234\n" in text  # in full, on its own line


def test_labels_say_what_is_not_the_default():
    rows = [
        BASE,
        row(parameters={"gain": 1.0, "damping": 1e-2}),
        row(policy="unheard_of", parameters={"a": 1}),
        row(policy="unheard_of", parameters={"a": 2}),
        row(policy="alone", parameters={"a": 2}),
    ]
    summaries = summarise(rows)
    names = report.labels(summaries)
    assert [names[id(s)] for s in summaries] == ["dls", "dls:damping=0.01", "unheard_of:a=1", "unheard_of:a=2", "alone"]


def test_what_is_skipped_is_said():
    skipped = [Skipped("zhang3-helix", "follow_nominal", "No path.")]
    assert "skipped: follow_nominal in zhang3-helix: No path." in report.table([BASE], skipped)
    assert "- follow_nominal in zhang3-helix: No path." in report.readme([BASE], skipped, command="c", date=DATE)


def test_readme():
    pictures = {"varga7-fast": {report.OVERVIEW: [("Costs", pathlib.PurePath("plots/a b/cost.png"))]}}
    text = report.readme([BASE, REFERENCE], command="python -m x", date=DATE, pictures=pictures)
    assert "## varga7-fast: 3000 steps" in text
    assert "| dls | 1.423e7 | 301.2 |" in text
    assert r"| follow_nominal \* |" in text
    assert "![Costs](plots/a%20b/cost.png)" in text
    assert "`python -m x`" in text
    assert "2026-01-02 03:04 UTC" in text
    assert r"machine: A \| B, 2 cores, ikgym 0.1.0" in text
    assert "`damping=0.001`" in text
    tables = [line for line in text.split("\n") if line.startswith("|")]
    heads = {len(re.findall(r"(?<!\\)\|", line)) for line in tables}
    assert heads == {13, 4}  # twelve columns of results, three of parameters


def test_readme_says_where_times_cannot_be_compared():
    other = row(seed=1, machine={"cpu": "C", "cores": 4, "ikgym": "0.1.0"})
    assert "different machines" in report.readme([BASE, other], command="c", date=DATE)
    assert "different machines" not in report.readme([BASE], command="c", date=DATE)


# Plots


def test_plots_of_a_small_run(tmp_path):
    evaluate(["faitli3-regular", "zhang3-helix"], ["dls", "follow_nominal"], steps=12, out=tmp_path)
    made = sorted(file.relative_to(tmp_path / "plots").as_posix() for file in tmp_path.glob("plots/*/*"))
    assert made == [
        "faitli3-regular/cost-time.png",
        "faitli3-regular/joints-dls.png",
        "faitli3-regular/joints-follow_nominal.png",
        "faitli3-regular/tracking.png",
        "faitli3-regular/velocities-dls.png",
        "faitli3-regular/velocities-follow_nominal.png",
        "zhang3-helix/cost-time.png",
        "zhang3-helix/joints-dls.png",
        "zhang3-helix/tracking.png",
        "zhang3-helix/velocities-dls.png",
    ]
    readme = (tmp_path / "README.md").read_text(encoding="utf-8")
    linked = re.findall(r"!\[.*?\]\((.*?)\)", readme)
    assert sorted(linked) == [f"plots/{name}" for name in made]
    assert all((tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in linked)


def test_accelerations_are_drawn_where_they_have_limits(tmp_path):
    evaluate(circle(steps=8), "dls", out=tmp_path)
    made = sorted(file.name for file in tmp_path.glob("plots/*/*"))
    assert made == ["accelerations-dls.png", "cost-time.png", "joints-dls.png", "tracking.png", "velocities-dls.png"]
    assert "Joint accelerations of dls in circle" in (tmp_path / "README.md").read_text(encoding="utf-8")


def test_the_log_has_the_accelerations_of_the_steps_from_rest():
    scenario = circle(steps=8)
    episode = rollout(scenario, baselines.make("dls", scenario), 0)
    log = trajectory_log(scenario, Seeds(0), episode)
    np.testing.assert_allclose(log["qddot"][0], episode.qdot[0] / scenario.dt)
    np.testing.assert_allclose(log["qddot"][1:], np.diff(episode.qdot, axis=0) / scenario.dt)
    np.testing.assert_array_equal(log["acceleration_limit"], scenario.arm.acceleration_limit)
    assert "qddot" not in trajectory_log(ikgym.scenarios.get("varga7-fast").replace(steps=8), Seeds(0), episode)


def test_a_damaged_course_is_named(tmp_path):
    evaluate("faitli3-regular", "dls", steps=5, out=tmp_path, plots=False)
    (file,) = tmp_path.glob("series/*/*.npz")
    file.write_bytes(b"nothing")
    with pytest.raises(ResultsError, match=re.escape(str(file))):
        evaluate("faitli3-regular", "dls", steps=5, out=tmp_path, resume=True)


def course(steps=60, coordinates=6, joints=7, **changes):
    rng = np.random.default_rng(0)
    series = {
        "time": np.arange(1, steps + 1) * 1e-3,
        "nominal": rng.normal(size=(steps, coordinates)),
        "pose": rng.normal(size=(steps, coordinates)),
        "q": rng.normal(size=(steps, joints)),
        "nominal_q": rng.normal(size=(steps, joints)),
        "qdot": rng.normal(size=(steps, joints)),
        "position_error": rng.uniform(1e-3, 1, steps),
        "orientation_error": rng.uniform(1e-3, 1, steps),
        "prismatic": np.arange(joints) == 2,
        "lower": np.full(joints, -np.inf),
        "upper": np.full(joints, np.inf),
        "velocity_limit": np.full(joints, np.inf),
    }
    return {**series, **changes}


def assert_every_axis_has_a_label_and_a_unit(figure):
    figure.draw_without_rendering()
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert all(re.search(r"\[.+\]$", label) for label in labels), labels
    assert any(axes.get_xlabel() == "time [s]" for axes in figure.axes)


@pytest.mark.parametrize("coordinates", [3, 6, 12, 5])
def test_axes_of_the_tracking_have_labels_and_units(coordinates):
    one = course(coordinates=coordinates)
    figure = tracking.draw("t", [("a", one), ("b *", one)])
    assert_every_axis_has_a_label_and_a_unit(figure)
    assert len(figure.axes) == coordinates + 2


@pytest.mark.parametrize("draw", [joints.draw_velocities, joints.draw_paths, joints.draw_accelerations])
def test_axes_of_the_joints_have_labels_and_units(draw):
    one = course()
    accelerations = {"qddot": one["qdot"], "acceleration_limit": np.full(7, 9.0)}
    assert_every_axis_has_a_label_and_a_unit(draw("j", {**one, **accelerations}))


def bands_of(axes):
    """Lower and upper ends of what is shaded across the whole width."""
    boxes = [patch.get_bbox() for patch in axes.patches if (patch.get_x(), patch.get_width()) == (0.0, 1.0)]
    return sorted((round(box.y0, 9), round(box.y1, 9)) for box in boxes)


def test_limits_that_are_near_are_shaded():
    q = np.zeros((60, 3))
    q[:, 0] = np.linspace(-1.0, 1.0, 60)
    q[:, 1] = np.linspace(-1.0, 0.5, 60)
    lower, upper = np.array([-np.inf, -1.0, -9.0]), np.array([1.2, 9.0, 9.0])
    one = course(joints=3, q=q, nominal_q=q, lower=lower, upper=upper)
    figure = joints.draw_paths("p", one)
    first, second, third = figure.axes
    assert bands_of(first) == [(1.2, pytest.approx(first.get_ylim()[1]))]
    assert bands_of(second) == [(pytest.approx(second.get_ylim()[0]), -1.0)]
    assert second.get_ylim()[0] < -1.0
    assert bands_of(third) == []
    assert [text.get_text() for text in figure.legends[0].texts] == ["actual", "nominal", bands.NAME]
    # Without a nominal joint path, too.
    figure = joints.draw_paths("p", {name: value for name, value in one.items() if name != "nominal_q"})
    assert [text.get_text() for text in figure.legends[0].texts] == ["actual", bands.NAME]
    qdot = np.sin(np.linspace(0.0, 6.0, 60))[:, None] * [1.0, 2.0, 0.1]
    figure = joints.draw_velocities("v", course(joints=3, qdot=qdot, velocity_limit=np.array([1.1, 2.0, 2.0])))
    assert bands_of(figure.axes[0])[1][0] == 2.0
    assert figure.legends[0].texts[-1].get_text() == bands.NAME
    dotted = [line.get_ydata()[0] for line in figure.axes[0].get_lines() if line.get_linestyle() == ":"]
    assert sorted(dotted) == [-2.0, -2.0, -1.1, 1.1, 2.0, 2.0]
    assert bands_of(joints.draw_velocities("v", course()).axes[0]) == []


def test_a_reference_below_the_errors_of_the_others_is_named():
    good = course(position_error=np.full(60, 1e-13))
    figure = tracking.draw("t", [("dls", course()), ("follow_nominal *", good)])
    (axes,) = (axes for axes in figure.axes if axes.get_ylabel() == "position error [m]")
    assert axes.get_title(loc="right") == "below the axis: follow_nominal *"
    assert axes.get_ylim()[0] > 1e-4


def test_the_nominal_is_in_sight_even_where_a_policy_has_lost_it():
    lost = course(pose=np.full((60, 6), 1e6))
    axes = tracking.draw("t", [("dls", lost)]).axes[0]
    nominal = lost["nominal"][:, 3]
    span = np.ptp(nominal)
    low, high = axes.get_ylim()
    assert low < nominal.min()
    assert nominal.max() < high < nominal.max() + span


def test_the_close_up_is_where_velocities_zigzag():
    qdot = np.zeros((1000, 3))
    qdot[:, 0] = np.linspace(0, 50, 1000)  # steep, yet smooth
    qdot[700:720:2, 1] = 1.0
    part = joints.busiest(qdot)
    assert part.stop - part.start == 50
    assert part.start <= 700
    assert part.stop >= 720
    assert joints.busiest(qdot[:4]) == slice(0, 4)
    assert joints.busiest(qdot[:1]) == slice(0, 1)


def test_one_policy_and_a_cost_of_zero_can_be_drawn():
    summaries = summarise([row(total_cost=0.0)])
    figure = cost_time.draw("t", summaries, {id(summaries[0]): "dls *"}, {id(summaries[0]): style.looks(0)})
    assert style.png(figure) == style.png(figure)


def test_lines_can_be_told_apart():
    looks = [tuple(style.looks(number).values()) for number in range(24)]
    assert len(set(looks)) == 24
