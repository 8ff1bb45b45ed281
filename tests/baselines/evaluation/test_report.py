import dataclasses
import datetime
import pathlib
import re

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.evaluate import evaluate
from baselines.evaluation import report, run
from baselines.evaluation.export import trajectory_log
from baselines.evaluation.jobs import Skipped
from baselines.evaluation.metrics import Row
from baselines.evaluation.plots import joints, style, tracking
from baselines.evaluation.summary import summarise
from baselines.evaluation.table import code, escaped, number
from baselines.files import ResultsError
from baselines.recording import Seeds
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
    followed=False,
    solver_status="converged",
    time_p50_us=16.21,
    time_p99_us=28.79,
    deadline_misses=1,
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
        (0.012345, 1e3, "12.35"),
        (0.0, 1.0, "0"),
        (None, 1.0, "–"),
        (float("nan"), 1.0, "–"),
        (float("inf"), 1.0, "inf"),
    ],
)
def test_numbers_have_four_digits(value, scale, text):
    assert number(value, scale) == text


def test_table():
    text = report.table([BASE, REFERENCE])
    lines = text.split("\n")
    assert lines[0] == "varga7-fast: 3000 steps"
    cells = "dls 1.423e7 301.2 1.416 16.88 13.31 500.0 16.21 28.79 1 no converged"
    assert lines[4].split() == cells.split()
    assert lines[5].startswith("follow_nominal *")
    assert "* reference: has privileged information" in text
    assert "[mm]" in lines[2]
    assert "[mrad]" in lines[2]
    assert "episodes" not in text
    assert "cost ratio" not in text  # no cost is known
    lines = report.table([dataclasses.replace(BASE, cost_ratio=2.0), REFERENCE]).split("\n")
    assert [line.split()[-10] for line in lines[4:6]] == ["2.000", "–"]


def test_a_policy_with_a_joint_at_a_stop_is_marked():
    stopped = row(policy="moore_penrose", parameters={}, steps_at_joint_limit=3)
    text = report.table([BASE, stopped, dataclasses.replace(REFERENCE, steps_at_joint_limit=1)])
    assert [line.partition("1.423e7")[0].strip() for line in text.split("\n")[4:7]] == [
        "dls",
        "moore_penrose †",
        "follow_nominal * †",
    ]
    assert report.STOP_NOTE in text
    assert "†" not in report.table([BASE, row(policy="moore_penrose", steps_at_velocity_limit=3)])
    assert summarise([stopped, dataclasses.replace(stopped, seed=1)])[0].total("steps_at_joint_limit") == 6


def test_a_peak_that_no_limit_was_stated_for_is_marked():
    text = report.table([BASE, row(policy="qp", scenario="own", acceleration_stated=False)])
    assert re.search(r"^qp:damping=0.001 .* 500\.0 § ", text, re.MULTILINE)
    assert text.count("500.0 §") == 1
    assert report.STATED_NOTE in text
    assert "§" not in report.table([BASE])


@pytest.mark.parametrize(
    ("changes", "stated"),
    [({}, True), ({"acceleration_limit": None}, False), ({"acceleration_limit": [9.0] * 6 + [np.inf]}, False)],
)
def test_a_row_knows_whether_accelerations_are_stated(changes, stated):
    (played,) = evaluate(circle(**changes), "dls", steps=3)
    assert played.acceleration_stated is stated
    (unlimited,) = evaluate("varga7-fast", "dls", steps=3)
    assert unlimited.acceleration_stated


def test_several_episodes_are_put_together():
    costs = {2_000_000: 10.0, 2_000_001: 1000.0, 2_000_002: 1e6}
    text = report.table([row(scenario="varga7-random", seed=seed, total_cost=cost) for seed, cost in costs.items()])
    assert text.startswith("varga7-random: 3 episodes of 3000 steps")
    assert text.split("\n")[4].endswith("0 of 3  converged")
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
    assert re.split(r"\s{2,}", text.split("\n")[4])[3] == "2.000"
    assert "Cost ratio over the episodes:" in report.readme(rows, command="c", date=DATE)
    assert "total cost over" in report.table([*rows, row(scenario="varga7-random", seed=10)])


WIDE = [
    row(
        solver_status="iteration_limit", total_cost=1.2345e-100, tracking_cost=1.2345e-100, position_error_max=1.2345e-9
    ),
    row(policy="rhc_gradient", parameters={"horizon": 50, "alpha_max": 1.2345e-5, "alpha_factor": 1.234}),
    REFERENCE,
]


@pytest.mark.parametrize("width", [80, 100, 120, 200])
def test_lines_fit_the_width(width):
    text = report.table(WIDE, [Skipped("zhang3-helix", "follow_nominal", "word " * 60)], width=width)
    assert max(len(line.replace("\u0307", "")) for line in text.split("\n")) <= width
    assert "rhc_gradient:horizon=50,alpha_max=1.2345e-05,alpha_factor=1.234\n" in text  # in full, on its own line


def test_columns_that_do_not_fit_are_named():
    narrow, wide = report.table(WIDE, width=80), report.table(WIDE, width=200)
    assert "left out" not in wide
    note = " ".join(narrow.partition("left out at 80 characters a line: ")[2].split())
    gone, head = note.split(", "), narrow.splitlines()[1].split()
    assert gone[-1] == "misses"
    assert not set(gone).intersection(head)
    assert {"policy", "total", "followed", "solver", "p50"} <= set(head)


def test_labels_say_what_is_not_the_default():
    rows = [
        BASE,
        row(parameters={"gain": 1.0, "damping": 1e-2}),
        row(policy="unheard_of", parameters={"a": 1}),
        row(policy="unheard_of", parameters={"a": 2}),
        row(policy="alone", parameters={"a": 2}),
    ]
    assert [one.label for one in summarise(rows)] == [
        "dls",
        "dls:damping=0.01",
        "unheard_of:a=1",
        "unheard_of:a=2",
        "alone",
    ]


def test_text_for_markdown():
    assert escaped("rhc:options={'a': 1}\n<b>_x*") == "rhc:options=\\{'a': 1\\} \\<b\\>\\_x\\*"
    assert escaped("moore_penrose __x__") == r"moore_penrose \_\_x\_\_"
    assert [code(text) for text in ("a b", "`a` | b", "``")] == ["`a b`", "`` `a` | b ``", "``` `` ```"]


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


HOSTILE = (
    "<script>run()</script> <img src=x onerror=run()> {run()} `{run()}` [x](javascript:run()) ![x](x) *x* _x_ | &lt;"
)


def test_nothing_in_a_name_is_markup_in_the_readme():
    """Read by a parser of Markdown: all of it is text or code."""
    markdown_it = pytest.importorskip("markdown_it")
    rows = [row(scenario=f"{HOSTILE}\n\n# x", policy=f"x:{HOSTILE}", parameters={HOSTILE: HOSTILE}, cost_ratio=0.5)]
    rows.append(dataclasses.replace(rows[0], seed=1))
    skipped = [Skipped(HOSTILE, HOSTILE, HOSTILE)]
    pictures = {rows[0].scenario: {report.OVERVIEW: [(HOSTILE, pathlib.PurePath("plots/cost.png"))]}}
    text = report.readme(rows, skipped, command=HOSTILE, date=DATE, pictures=pictures)
    blocks = markdown_it.MarkdownIt("commonmark").enable("table").parse(text)
    parts = [part for block in blocks for part in (block, *(block.children or ()))]
    kinds = {part.type for part in parts}
    assert not kinds & {"html_block", "html_inline", "link_open", "strong_open"}
    assert [part.attrs["src"] for part in parts if part.type == "image"] == ["plots/cost.png"]
    assert [part.content for part in parts if part.type == "heading_open" and part.tag == "h1"] == [""]
    assert sum(part.content == HOSTILE for part in parts if part.type == "code_inline") == 1
    plain = "".join(part.content for part in parts if part.type in ("text", "text_special", "code_inline"))
    assert plain.count("{run()}") == plain.count("<script>run()</script>") * 2
    # MDX, which evaluates what is in braces, sees none.
    bare = re.sub(r"(`+).*?(?<!`)\1(?!`)", "", text)
    assert not re.search(r"(?<!\\)[{<]", bare)


# Plots


def test_plots_of_a_small_run(tmp_path):
    names = ["accelerations-dls", "cost-time", "joints-dls", "tracking", "velocities-dls"]
    scenario = circle(steps=8).replace(name=r"$\no_formula{$")
    evaluate(scenario, "dls", steps=8, out=tmp_path, report=False, plots=True)
    made = sorted(file.relative_to(tmp_path / "plots").as_posix() for file in tmp_path.glob("plots/*/*"))
    assert made == [f"_no_formula_/{name}.png" for name in names]
    linked = re.findall(r"!\[.*?\]\((.*?)\)", (tmp_path / "README.md").read_text(encoding="utf-8"))
    assert sorted(linked) == [f"plots/{name}" for name in made]
    assert all((tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in linked)


def test_the_log_has_the_accelerations_of_the_steps_from_rest():
    scenario = circle(steps=8)
    episode = rollout(scenario, baselines.make("dls", scenario), 0)
    log = trajectory_log(scenario, Seeds(0), episode)
    np.testing.assert_allclose(log["qddot"][0], episode.qdot[0] / scenario.dt)
    np.testing.assert_allclose(log["qddot"][1:], np.diff(episode.qdot, axis=0) / scenario.dt)
    assert "qddot" not in trajectory_log(ikgym.scenarios.get("varga7-fast").replace(steps=8), Seeds(0), episode)


def test_a_damaged_log_is_named_before_anything_is_played(tmp_path, monkeypatch):
    given = {"scenarios": "faitli3-regular", "steps": 5, "out": tmp_path}
    evaluate(**given, policies="dls")
    monkeypatch.setattr(run, "run", None)
    (file,) = tmp_path.glob("series/*/*.npz")
    with np.load(file) as arrays:
        log = dict(arrays)
    spoilt = [
        ({"other": np.zeros(3)}, "There is no array of a log 'other'"),
        ({name: array for name, array in log.items() if name != "nominal"}, "in the array nominal, got shape None"),
        (log | {"nominal": np.zeros(3)}, r"of shape \('k', 'm'\) in the array nominal, got shape \(3,\)"),
        (log | {"q": log["q"][:-1]}, "of the array q does not fit the others"),
        (log | {"time": log["time"].astype(str)}, "expected numbers of shape"),
    ]
    for arrays, message in spoilt:
        np.savez(file, **arrays)
        with pytest.raises(ResultsError, match=rf"{re.escape(str(file))} is damaged, .*{message}"):
            evaluate(**given, policies=["dls", "moore_penrose"], resume=True)
    file.write_bytes(b"nothing")
    with pytest.raises(ResultsError, match=re.escape(str(file))):
        evaluate(**given, policies="dls", resume=True)


def log_of(steps=60, coordinates=6, joints=7, **changes):
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
        "joint_names": np.array([f"joint{j}" for j in range(joints)]),
        "prismatic": np.arange(joints) == 2,
        "lower": np.full(joints, -np.inf),
        "upper": np.full(joints, np.inf),
        "velocity_limit": np.full(joints, np.inf),
    }
    return {**series, **changes}


def assert_every_axis_has_a_label_and_a_unit(figure):
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert all(re.search(r"\[.+\]$", label) for label in labels), labels
    assert any(axes.get_xlabel() == "time [s]" for axes in figure.axes)


@pytest.mark.parametrize("coordinates", [3, 12])
def test_the_tracking_shows_errors_and_then_the_position(coordinates):
    one = log_of(coordinates=coordinates)
    figure = tracking.draw("t", [("a", one), ("b *", one)])
    assert_every_axis_has_a_label_and_a_unit(figure)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["position error [m]", "orientation error [rad]", "x [m]", "y [m]", "z [m]"]
    figure.draw_without_rendering()
    heights = [axes.get_position().height for axes in figure.axes]
    assert max(heights) < 1.01 * min(heights)
    for axes, nominal in zip(figure.axes[2:], one["nominal"].T[-3:], strict=True):
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), nominal)


@pytest.mark.parametrize("quantity", joints.QUANTITIES)
def test_axes_of_the_joints_have_labels_and_units(quantity):
    one = log_of()
    accelerations = {"qddot": one["qdot"], "acceleration_limit": np.full(7, 9.0)}
    figure = joints.draw("j", {**one, "joint_names": np.array(list("abcdef$")), **accelerations}, quantity)
    assert_every_axis_has_a_label_and_a_unit(figure)
    assert [axes.get_title(loc="left") for axes in figure.axes] == [*"abcdef", r"\$"]


def test_rounding_errors_are_not_enlarged():
    q = np.full((60, 7), -4.7) + 1e-8 * np.random.default_rng(0).normal(size=(60, 7))
    for axes in joints.draw("p", log_of(q=q, nominal_q=q), joints.PATHS).axes:
        low, high = axes.get_ylim()
        assert high - low == pytest.approx(joints.SPAN)


def bands_of(axes):
    """Lower and upper ends of what is shaded across the whole width."""
    boxes = [patch.get_bbox() for patch in axes.patches if (patch.get_x(), patch.get_width()) == (0.0, 1.0)]
    return sorted((round(box.y0, 9), round(box.y1, 9)) for box in boxes)


def test_limits_that_are_near_are_shaded():
    q = np.zeros((60, 3))
    q[:, 0] = np.linspace(-1.0, 1.0, 60)
    q[:, 1] = np.linspace(-1.0, 0.5, 60)
    lower, upper = np.array([-np.inf, -1.0, -9.0]), np.array([1.2, 9.0, 9.0])
    one = log_of(joints=3, q=q, nominal_q=q, lower=lower, upper=upper)
    figure = joints.draw("p", one, joints.PATHS)
    first, second, third = figure.axes
    assert bands_of(first) == [(1.2, pytest.approx(first.get_ylim()[1]))]
    assert bands_of(second) == [(pytest.approx(second.get_ylim()[0]), -1.0)]
    assert second.get_ylim()[0] < -1.0
    assert bands_of(third) == []
    assert [text.get_text() for text in figure.legends[0].texts] == ["actual", "nominal", joints.BEYOND]


def test_a_reference_below_the_errors_of_the_others_is_named():
    good = log_of(position_error=np.full(60, 1e-13))
    figure = tracking.draw("t", [("dls", log_of()), ("follow_nominal *", good)])
    axes = figure.axes[0]
    assert axes.get_title(loc="right") == "below the axis: follow_nominal *"
    assert axes.get_ylim()[0] > 1e-4


def test_the_nominal_is_in_sight_even_where_a_policy_has_lost_it():
    lost = log_of(pose=np.full((60, 6), 1e6))
    axes = tracking.draw("t", [("dls", lost)]).axes[2]
    nominal = lost["nominal"][:, 3]
    span = np.ptp(nominal)
    low, high = axes.get_ylim()
    assert low < nominal.min()
    assert nominal.max() < high < nominal.max() + span


def test_lines_are_distinguishable():
    assert len({tuple(style.looks(number).values()) for number in range(24)}) == 24
