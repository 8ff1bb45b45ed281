import dataclasses
import datetime
import json
import re

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.evaluate import evaluate
from baselines.evaluation import report
from baselines.evaluation.columns import number
from baselines.evaluation.log import trajectory_log
from baselines.evaluation.metrics import Row, Skipped
from baselines.evaluation.plots import tracking
from baselines.evaluation.results import read_rows
from baselines.evaluation.summary import summarise
from tests.baselines.making import circle

BASE = Row(
    scenario="varga7-fast", policy="dls", parameters={"gain": 1.0, "damping": 1e-3}, seed=0, steps=3000,
    total_cost=1.423456e7, tracking_cost=301.25, velocity_cost=1.4234e7, cost_ratio=None,
    position_error_max=1.416e-3, position_error_rms=1e-4, orientation_error_max=0.01688, orientation_error_rms=1e-3,
    qdot_peak=13.3125, qdot_rms=2.0, qdot_total_variation=100.0, qddot_peak=500.0,
    steps_at_joint_limit=0, steps_at_velocity_limit=0, steps_at_acceleration_limit=0, joint_limit_margin_min=None,
    followed=False, solver_status="converged", time_p50_us=16.21, time_p99_us=28.79, deadline_misses=1,
    machine={"cpu": "A | B", "cores": 2, "ikgym": "0.1.0"}, iterations=1.0, status_counts={"converged": 3000},
    preview=1, fingerprint="0", time_first_us=120.0, test_set=None,
)  # fmt: skip
REFERENCE = dataclasses.replace(BASE, policy="follow_nominal", parameters={}, tracking_cost=0.0)
DATE = datetime.datetime(2026, 1, 2, 3, 4, tzinfo=datetime.UTC)


def table(rows, *arguments, **options):
    return report.table(summarise(rows), *arguments, **options)


def readme(rows, *arguments, **options):
    return report.readme(summarise(rows), *arguments, **options)


def row(**changes):
    return dataclasses.replace(BASE, **changes)


def test_numbers_have_four_digits():
    values = {1.423456e7: "1.423e7", 301.25: "301.2", 1234.4: "1234", 0.0: "0", None: "–", np.nan: "–", np.inf: "inf"}
    assert [number(value) for value in values] == list(values.values())


def test_table():
    text = table([BASE, REFERENCE])
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
    lines = table([dataclasses.replace(BASE, cost_ratio=2.0), REFERENCE]).split("\n")
    assert [line.split()[-10] for line in lines[4:6]] == ["2.000", "–"]


def test_joints_at_stops_and_peaks_without_a_stated_limit_are_marked():
    stopped = row(policy="moore_penrose", parameters={}, steps_at_joint_limit=3)
    text = table([stopped, dataclasses.replace(REFERENCE, steps_at_joint_limit=1)])
    names = [line.partition("1.423e7")[0].strip() for line in text.split("\n")[4:6]]
    assert names == ["moore_penrose †", "follow_nominal * †"]
    assert report.STOP_NOTE in text
    text = table([BASE, row(policy="qp", scenario="mine", acceleration_stated=False)])
    assert re.search(r"^qp:damping=0.001 .* 500\.0 § ", text, re.MULTILINE)
    assert text.count("500.0 §") == 1
    assert report.STATED_NOTE in text
    assert not {"†", "§"} & set(table([BASE, row(policy="moore_penrose", steps_at_velocity_limit=3)]))


@pytest.mark.parametrize(
    ("changes", "stated"),
    [({}, True), ({"acceleration_limit": None}, False), ({"acceleration_limit": [9.0] * 6 + [np.inf]}, False)],
)
def test_a_row_knows_whether_accelerations_are_stated(changes, stated):
    (played,) = evaluate(circle(**changes), "dls", steps=3)
    assert played.acceleration_stated is stated
    (unlimited,) = evaluate("varga7-fast", "dls", steps=3)
    assert unlimited.acceleration_stated


def cells(line):
    return re.split(r"\s{2,}", line)


def test_several_episodes_are_put_together():
    given = zip((1, 2, 3), (10.0, 1000.0, 1e6), (0.03, 0.01, 0.2), (5.0, 7.0, 6.0), strict=True)
    rows = [
        row(seed=seed, total_cost=cost, position_error_max=error, time_p50_us=time, time_p99_us=2 * time,
            deadline_misses=seed, solver_status="rank_deficient" if seed == 2 else "converged", followed=error < 0.2)
        for seed, cost, error, time in given
    ]  # fmt: skip
    text = table(rows)
    assert text.startswith("varga7-fast: 3 episodes of 3000 steps")
    line = "dls 2154 301.2 200.0 16.88 13.31 500.0 6.000 14.00 6 2 of 3 rank_deficient"
    assert text.split("\n")[4].split() == line.split()
    last = [line for line in text.split("\n") if line.startswith("dls")][-1]
    assert cells(last) == ["dls", "3", "2154", "1000", "8.002e5", "1.000e6", "3", "1"]
    assert "geometric means" in text
    assert "total cost over the episodes of varga7-fast" in text


def test_several_episodes_are_judged_by_their_cost_ratio_where_it_is_known():
    given = zip((7, 8, 9), (1.0, 4.0, 2.0), (0.0, 0.06, 0.0), strict=True)
    rows = [row(seed=seed, cost_ratio=ratio, position_error_max=error) for seed, ratio, error in given]
    text = table(rows)
    assert "cost ratio over the episodes of varga7-fast" in text
    assert "total cost over" not in text
    first, last = (line for line in text.split("\n") if line.startswith("dls"))
    assert cells(first)[3] == "2.000"
    assert cells(last) == ["dls", "3", "2.000", "2.000", "3.600", "4.000", "8", "1"]
    assert "total cost over" in table([*rows, row(seed=10)])


TINY = {"total_cost": 1.2345e-100, "tracking_cost": 1.2345e-100, "position_error_max": 1.2345e-9}
WIDE = [
    row(solver_status="iteration_limit", **TINY),
    row(policy="rhc_gradient", parameters={"horizon": 50, "alpha_max": 1.2345e-5, "alpha_factor": 1.234}),
    REFERENCE,
]


def test_lines_fit_the_width_and_columns_that_do_not_are_named():
    for width in (80, 120):
        text = table(WIDE, [Skipped("zhang3-helix", "follow_nominal", "word " * 60)], width=width)
        assert max(len(line.replace("\u0307", "")) for line in text.split("\n")) <= width
        assert (
            "rhc_gradient:horizon=50,alpha_max=1.2345e-05,alpha_factor=1.234\n" in text
        )  # in full, on a separate line
    narrow, wide = table(WIDE, width=80), table(WIDE, width=200)
    assert "left out" not in wide
    gone, head = narrow.partition("left out at 80 characters a line: ")[2], narrow.splitlines()[1].split()
    gone = " ".join(gone.split()).split(", ")
    assert gone[-1] == "misses"
    assert not set(gone).intersection(head)
    assert {"policy", "total", "followed", "solver", "p50"} <= set(head)


def test_labels_say_what_is_not_the_default():
    given = [("dls", {"gain": 1.0, "damping": 1e-3}), ("dls", {"gain": 1.0, "damping": 1e-2}), ("new", {"a": 1})]
    rows = [row(policy=policy, parameters=values) for policy, values in [*given, ("new", {"a": 2}), ("one", {"a": 2})]]
    assert summarise(rows).label.tolist() == ["dls", "dls:damping=0.01", "new:a=1", "new:a=2", "one"]


def test_readme():
    skipped = [Skipped("zhang3-helix", "follow_nominal", "needs a joint path")]
    text = readme([BASE, REFERENCE], skipped, command="python -m x", date=DATE)
    for part in (
        "varga7-fast: 3000 steps\n",
        "command: python -m x",
        "finished: 2026-01-02 03:04 UTC",
        "machine: A | B, 2 cores, ikgym 0.1.0",
        "dls in varga7-fast: gain=1.0, damping=0.001",
        "skipped: follow_nominal in zhang3-helix: needs a joint path",
    ):
        assert part in text


def test_control_characters_and_line_breaks_of_names_are_escaped(tmp_path, capsys):
    """In all files that are read by people, and in the progress bar; the name itself stays."""
    name, bad = "a\x1b[31m\n\u202eb\x9b", {"\x1b", "\u202e", "\x9b"}
    scenario = ikgym.scenarios.get("varga7-fast").replace(name=name)
    joints = scenario.arm.replace(joint_names=[f"{name}{i}" for i in range(7)])
    evaluate(scenario.replace(arm=joints), "dls", steps=3, out=tmp_path, progress=True, export="joint-trajectory")
    readme, results = (tmp_path / file for file in ("README.md", "results.json"))
    (motion,) = tmp_path.glob("export/*/*.json")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for text in (*(file.read_text(encoding="utf-8") for file in (readme, results, motion)), capsys.readouterr().err):
        assert not set(text) & bad
    shown = r"a\x1b[31m\n\u202eb\x9b"
    assert f"{shown}: 3 steps" in readme.read_text(encoding="utf-8")
    assert f"<td>{shown}</td>" in page
    ours = re.sub(r"<script(?! type=.application/json).*?</script>", "", page, flags=re.DOTALL)  # without libraries
    assert not set(ours) & bad
    data = json.loads(re.search(r'id="data">(.*?)</script>', page, re.DOTALL)[1])[0]
    assert (data["scenario"], data["series"]["joint_names"][0]) == (shown, f"{shown}0")
    assert read_rows(results)[0].scenario == name


def test_nothing_in_a_name_is_markup_in_the_readme():
    """Read by a parser of Markdown: a head, and one block of code."""
    markdown_it = pytest.importorskip("markdown_it")
    name = "<script>run()</script> {run()} `{run()}` [x](javascript:run())\n\n# x\n```\n````"
    rows = [row(scenario=name, policy=f"x:{name}", parameters={name: name}, cost_ratio=0.5)]
    text = readme(rows, [Skipped(name, name, name)], command=name, date=DATE)
    blocks = markdown_it.MarkdownIt("commonmark").parse(text)
    assert [block.type for block in blocks] == ["heading_open", "inline", "heading_close", "fence"]


def test_the_log_has_the_accelerations_of_the_steps_from_rest():
    scenario = circle(steps=8)
    episode = rollout(scenario, baselines.make("dls", scenario), 0)
    log = trajectory_log(episode)
    np.testing.assert_allclose(log["qddot"][0], episode.qdot[0] / scenario.dt)
    np.testing.assert_allclose(log["qddot"][1:], np.diff(episode.qdot, axis=0) / scenario.dt)
    unlimited = ikgym.scenarios.get("varga7-fast").replace(steps=8)
    assert "qddot" not in trajectory_log(rollout(unlimited, baselines.make("dls", unlimited), 0))


def log_of(**changes):
    rng = np.random.default_rng(0)
    log = {"time": np.arange(1, 61) * 1e-3}
    log |= {name: rng.normal(size=(60, 12)) for name in ("nominal", "pose")}
    log |= {f"{name}_error": rng.uniform(1e-3, 1, 60) for name in ("position", "orientation")}
    return {**log, **changes}


def test_the_plot_shows_errors_and_then_the_position():
    log = log_of(clearance=np.linspace(0.0, 1.0, 60))
    axes = tracking.draw("t", log).axes
    labels = ["position error [m]", "orientation error [rad]", "clearance [m]", "x [m]", "y [m]", "z [m]"]
    assert [one.get_ylabel() for one in axes] == labels
    assert {one.get_xlabel() for one in axes[3:]} == {"time [s]"}
    for one, nominal in zip(axes[3:], log["nominal"].T[-3:], strict=True):
        np.testing.assert_array_equal(one.lines[0].get_ydata(), nominal)


def test_the_nominal_is_in_sight_even_where_a_policy_has_lost_it():
    lost = log_of(pose=np.full((60, 12), 1e6))
    nominal = lost["nominal"][:, -3]
    low, high = tracking.draw("t", lost).axes[2].get_ylim()
    assert low < nominal.min()
    assert nominal.max() < high < nominal.max() + np.ptp(nominal)
