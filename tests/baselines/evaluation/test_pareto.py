"""Cost against time: who is compared, how episodes become points, and that the page in the tree is what they say."""

import dataclasses
import io
import pathlib
import re

import numpy as np
import PIL.Image
import pytest
from matplotlib.text import Annotation, Text

import baselines
from baselines import registry
from baselines.agents.policy import LearnedPolicy
from baselines.evaluate import evaluate
from baselines.evaluation import test_sets
from baselines.evaluation.metrics import Spread, summarise
from baselines.evaluation.pareto import __main__ as command
from baselines.evaluation.pareto.__main__ import main
from baselines.evaluation.pareto.contenders import (
    BLOCKS,
    FAMILIES,
    HORIZONS,
    OPTIMUM,
    OPTIMUM_BLOCKS,
    REAL_TIME,
    SEEDS,
    Contender,
    blocks,
    contenders,
    family,
)
from baselines.evaluation.pareto.measure import fixed, measure, plan
from baselines.evaluation.pareto.page import page, pictures
from baselines.evaluation.pareto.points import Measured, Measurement, Point, front
from baselines.evaluation.plots import cost_time, style
from baselines.files import ResultsError
from baselines.oracle import best_known
from baselines.oracle.best_known import UPDATE, Record, episode_hash
from baselines.solvers.wrappers.full_orientation import FullOrientation
from baselines.spec import parse_policy
from ikgym import scenarios

DOCS = pathlib.Path(__file__).parents[3] / "docs"
REMEDY = "draw it up again with `python -m baselines.pareto --write docs/pareto.md`"
NAME = "varga7-random"
FEW = (
    Contender("dls"),
    Contender("rhc:horizon=3,iterations=1"),
    Contender("rhc_foresight:stop_at_end=True", (0, 4), timed=2),
)


def point(spec, cost, p50=10.0, p99=20.0, *, lost=0):
    return Point(spec, tuple(cost), lost, timed=1, time_p50_us=p50, time_p99_us=p99, time_first_us=30.0)


def a_set(*points, seeds=(2_000_000, 2_000_001), name=NAME):
    return Measured(name, fingerprint_of(name), seeds, points)


def fingerprint_of(name):
    return plan(name, [Contender("dls")], 1)["dls"][0].fingerprint


@pytest.fixture
def records(tmp_path, monkeypatch):
    """Lets best known costs be what a test says, by seed."""
    path = tmp_path / "best.json"
    monkeypatch.setattr(best_known, "DATA", path)

    def known(name, costs):
        scenario = scenarios.get(name)
        best_known.record(
            [Record(name, s, cost, "a test", 0.0, {}, episode_hash(scenario, s)) for s, cost in costs.items()], path
        )

    return known


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("pareto")


@pytest.fixture(scope="module")
def played(out):
    return measure(NAME, FEW, out, episodes=2)


class TestContenders:
    def test_whoever_can_be_chosen_is_there(self):
        there = {parse_policy(c.spec)[0] for c in contenders()}
        # Agents, and what is shown other coordinates, are on the leaderboard.
        elsewhere = {
            name for name in baselines.names() if issubclass(registry.get(name), (LearnedPolicy, FullOrientation))
        }
        assert there == {name for name in baselines.names() if not registry.get(name).reference} - elsewhere

    def test_each_once(self):
        specs = [c.spec for c in contenders()]
        assert len(set(specs)) == len(specs)

    def test_families_have_all_horizons(self):
        members = [family(c.spec) for c in contenders() if family(c.spec)]
        assert HORIZONS == (3, 5, 10, 30, 100, 200, 400)
        for name in (OPTIMUM, REAL_TIME):
            assert [horizon for kind, horizon in members if kind == name] == list(HORIZONS)
        for name in (OPTIMUM_BLOCKS, BLOCKS):
            assert [horizon for kind, horizon in members if kind == name] == [30, 100, 200, 400]

    @pytest.mark.parametrize(
        ("spec", "expected"),
        [
            ("rhc:horizon=30", (OPTIMUM, 30)),
            ("rhc:horizon=5,iterations=1", (REAL_TIME, 5)),
            ("rhc:horizon=400,iterations=1,move_blocks=30", (BLOCKS, 400)),
            ("rhc:horizon=400,move_blocks=30", (OPTIMUM_BLOCKS, 400)),
            ("rhc:horizon=30,starts=4", None),
            ("rhc", None),
            ("rhc_foresight:horizon=30", None),
            ("dls", None),
        ],
    )
    def test_family(self, spec, expected):
        assert family(spec) == expected

    @pytest.mark.parametrize(("horizon", "knots"), [(3, None), (10, None), (30, 17), (100, 23), (400, 30)])
    def test_blocks(self, horizon, knots):
        assert blocks(horizon) == knots

    def test_presets_that_draw_have_three_seeds_and_know_the_end_or_not(self):
        found = {c.spec: c for c in contenders() if c.spec.startswith("rhc_foresight")}
        assert list(found) == ["rhc_foresight:stop_at_end=True", "rhc_foresight:stop_at_end=False"]
        for contender in found.values():
            assert contender.seeds == SEEDS == (0, 1, 2)
            assert contender.timed > 1
            assert [parameters["seed"] for _, parameters in contender.variants] == [0, 1, 2]
        assert Contender("dls").variants == [("dls", {})]


class TestMeasure:
    def test_fixed_scenarios(self):
        assert {"varga7-fast", "varga7-slow", "faitli3-regular", "zhang3-helix"} <= set(fixed())
        assert not {"khan8-q1", NAME} & set(fixed())

    def test_points_are_what_an_evaluation_gives(self, played):
        assert [p.spec for p in played.points] == [c.spec for c in FEW]
        assert played.seeds == (2_000_000, 2_000_001)
        assert not played.stale
        rows = evaluate(NAME, ["dls", "rhc_foresight:seed=0", "rhc_foresight:seed=4"], episodes=2)
        costs = [row.total_cost for row in rows]
        assert played.points[0].cost == pytest.approx(costs[:2], rel=1e-6)
        assert played.points[2].cost == pytest.approx(costs[2:], rel=1e-6)
        assert costs[2:4] != costs[4:]
        assert played.points[0].lost == sum(row.position_error_max > 0.05 for row in rows[:2])

    def test_so_many_are_timed(self, played):
        assert [p.timed for p in played.points] == [1, 1, 4]
        for one in played.points:
            assert 0.0 < one.time_p50_us <= one.time_p99_us

    def test_what_is_done_is_not_done_again(self, played, out, monkeypatch):
        monkeypatch.setattr("baselines.evaluation.runner.play", lambda *_: pytest.fail("played again"))
        assert measure(NAME, FEW, out, episodes=2, resume=True) == played

    def test_who_does_not_suit_is_left_out(self):
        assert list(plan("khan8-q1", [Contender("dls"), Contender("follow_nominal")])) == ["dls", "follow_nominal"]
        assert list(plan("zhang3-helix", [Contender("dls"), Contender("follow_nominal")])) == ["dls"]

    def test_jobs_belong_to_the_frozen_set(self):
        jobs = plan(NAME, FEW)
        assert {job.test_set for of in jobs.values() for job in of} == {test_sets.SETS[NAME].digest}
        assert [len(of) for of in jobs.values()] == [64, 64, 128]


class TestPoints:
    def test_of_rows(self):
        (row,) = evaluate(NAME, "dls")
        rows = [
            dataclasses.replace(
                row, total_cost=1.23456789, position_error_max=0.0501, time_p50_us=1.0, time_p99_us=7.0
            ),
            dataclasses.replace(row, total_cost=2.0, position_error_max=0.0499, time_p50_us=3.0, time_p99_us=5.0),
            dataclasses.replace(
                row, total_cost=3.0, position_error_max=0.0, time_p50_us=None, time_p99_us=None, time_first_us=None
            ),
        ]
        first = max(one.time_first_us for one in rows[:2])
        found = Point.of("dls", rows)
        assert found == Point("dls", (1.234568, 2.0, 3.0), 1, 2, 2.0, 7.0, pytest.approx(first, rel=1e-3))

    def test_cost_ratio_of_several_seeds(self, records):
        records(NAME, {2_000_000: 2.0, 2_000_001: 4.0})
        one = a_set(point("dls", [2.0, 16.0]), point("rhc_foresight:stop_at_end=True", [2.0, 4.0, 8.0, 4.0]))
        of_dls, of_preset = one.spreads().values()
        assert (of_dls.mean, of_dls.worst) == pytest.approx((2.0, 4.0))
        assert (of_preset.mean, of_preset.worst) == pytest.approx((2.0**0.5, 4.0))

    def test_cost_where_a_record_is_missing(self, records):
        records(NAME, {2_000_000: 2.0})
        one = a_set(point("dls", [2.0, 8.0]))
        assert one.best_known() is None
        assert one.spreads()["dls"].mean == pytest.approx(4.0)

    def test_front(self, records):
        records(NAME, {2_000_000: 1.0})
        points = [
            point("dls", [9.0], 1.0, 60.0),
            point("mfac", [9.0], 2.0, 50.0),
            point("broyden", [5.0], 2.0, 70.0),
            point("mfapc", [5.0], 3.0, 40.0),
            point("rhc", [2.0], 9.0, 30.0),
            point("smoothed", [3.0], 10.0, 20.0),
        ]
        one = a_set(*points, seeds=(2_000_000,))
        assert front(one) == ["dls", "broyden", "rhc"]
        assert front(one, "time_p99_us") == ["smoothed", "rhc"]

    def test_a_file_is_read_as_it_was_written(self, tmp_path):
        there = Measurement("a command", "2000-01-01", {"cpu": "x"}, (a_set(point("dls", [1.0, 2.5e7])), a_set()))
        there.save(tmp_path / "it.json")
        assert Measurement.load(tmp_path / "it.json") == there

    @pytest.mark.parametrize("text", ["", "[]", '{"sets": []}', '{"sets": [{"name": "x"}]}'])
    def test_damaged(self, tmp_path, text):
        (tmp_path / "it.json").write_text(text)
        with pytest.raises(ResultsError, match=r"it\.json"):
            Measurement.load(tmp_path / "it.json")

    def test_stale(self):
        assert dataclasses.replace(a_set(), fingerprint="0" * 12).stale


class TestPage:
    @pytest.fixture
    def measurement(self, records):
        records(NAME, {2_000_000: 1.0, 2_000_001: 1.0})
        points = [
            point("dls", [40.0, 90.0], 15.0, 20.0, lost=1),
            point("broyden", [100.0, 100.0], 14.0, 500.0),
            point("mfac", [70.0, 90.0], 16.0, 30.0),
            *(point(f"rhc:horizon={h}", [1 + 9 / h] * 2, 6.0 * h, 9.0 * h) for h in (3, 30, 400)),
            *(point(f"rhc:horizon={h},iterations=1", [1 + 10 / h] * 2, 20.0 + h, 30.0 + h) for h in (3, 30, 400)),
            point("rhc_foresight:stop_at_end=True", [1.02, 1.02], 100.0, 120.0),
            point("rhc_foresight:stop_at_end=False", [1.02 * 1.1, 1.02 * 1.1], 101.0, 121.0),
        ]
        return Measurement("a command", "2000-01-01", {"cpu": "a machine"}, (a_set(*points),))

    def test_what_it_says(self, measurement):
        text = page(measurement)
        lines = text.splitlines()
        (of_dls,) = [line for line in lines if line.startswith("| ● | `dls`")]
        # Geometric mean, median, p90 and worst, the share lost, times, episodes.
        assert of_dls == "| ● | `dls` | 60.00 | 65.00 | 85.00 | 90.00 | 50 % | 15 | 20 | 30 | 2 | 1 |"
        assert any(line.startswith("| ● | `broyden`") for line in lines)
        assert any(line.startswith("|  | `mfac` | 79.37 |") for line in lines)
        assert "`rhc_foresight` by +10.0 % in the geometric mean, by +10.0 % in the median" in text
        choice = text.split("## How to choose")[1].split("| horizon |")[0]
        chosen = re.findall(r"\| (\d+) \| `(\S+)`", choice)
        assert chosen == [
            ("20", "dls"),
            ("27", "rhc:horizon=3"),
            ("60", "rhc:horizon=30,iterations=1"),
            ("120", "rhc_foresight:stop_at_end=True"),
        ]
        assert "| 30 | 1.300 | 180 | – | – | 1.333 | 50 | – | – |" in text
        assert "- date: 2000-01-01" in lines

    def test_seeds_are_counted(self, measurement):
        (one,) = measurement.sets
        preset = point("rhc_foresight:stop_at_end=True", [2.0] * 6)
        text = page(dataclasses.replace(measurement, sets=(dataclasses.replace(one, points=(preset,)),)))
        assert "| 3 × 2 | 1 |" in text

    def test_pictures(self, measurement):
        ((place, figure),) = pictures(measurement)
        assert f"]({place.as_posix()})" in page(measurement)
        assert figure.axes[0].get_ylabel() == "cost ratio [1], geometric mean"
        handles = figure.legends[0].legend_handles
        assert len({handle.get_color() for handle in handles[:2]}) == 2, "a colour for each family"
        figure.draw_without_rendering()
        renderer = figure.canvas.get_renderer()
        texts = [t for t in figure.axes[0].texts if isinstance(t, Annotation)]
        names = {t.get_text() for t in texts}
        assert {"dls", "3", "400", "rhc_foresight, stop_at_end off", "deadline, 1 ms"} <= names
        boxes = [Text.get_window_extent(t, renderer) for t in texts]
        for number, box in enumerate(boxes):
            assert not any(box.overlaps(other) for other in boxes[:number]), texts[number].get_text()

    def test_costs_where_no_cost_ratio_is_known(self, measurement, monkeypatch, tmp_path):
        monkeypatch.setattr(best_known, "DATA", tmp_path / "none.json")
        ((_, figure),) = pictures(measurement)
        assert figure.axes[0].get_ylabel() == "total cost [1], geometric mean"
        assert "| policy | cost | median |" in page(measurement)


class TestRegretInPlots:
    """What the plots of an evaluation share with those here."""

    def test_it_is_drawn_where_it_is_known(self):
        (row,) = evaluate(NAME, "dls")
        for cost_ratio, label in ((1.5, "cost ratio [1]"), (None, "total cost [1]")):
            summaries = summarise([dataclasses.replace(row, cost_ratio=cost_ratio)])
            drawn = cost_time.draw("t", summaries, {id(summaries[0]): "dls"}, {id(summaries[0]): {"color": "k"}})
            assert drawn.axes[0].get_ylabel() == label

    def test_its_axis_is_logarithmic_in_what_it_exceeds_1_by(self):
        axes = style.figure(3.0).subplots()
        values = [1.001, 1.01, 1.1, 2.0, 11.0]
        marks = [cost_time.Mark(10.0, Spread(value, value, value, value, 0), "x", "k") for value in values]
        cost_time.scatter(axes, marks, cost_ratio=True, several=False)
        places = axes.yaxis.get_transform().transform(values)
        assert np.diff(places) == pytest.approx(1.0)
        assert axes.yaxis.get_transform().inverted().transform(places) == pytest.approx(values)
        shown = [text.get_text() for text in axes.get_yticklabels()]
        assert {"1.001", "1.1", "2", "10"} <= set(shown)


class TestCommandLine:
    def test_plays_writes_and_draws_up_again(self, tmp_path, capsys, monkeypatch):
        monkeypatch.setattr(command, "contenders", lambda *_, **__: FEW[:2])
        file = tmp_path / "page" / "pareto.md"
        arguments = ["--sets", NAME, "--episodes", "1", "--out", str(tmp_path / "out"), "--write", str(file)]
        assert main(arguments) == 0
        assert str(file) in capsys.readouterr().out
        text = file.read_text(encoding="utf-8")
        assert f"`python -m baselines.pareto {' '.join(arguments)}`" in text
        picture = PIL.Image.open(io.BytesIO((file.parent / "images" / f"pareto-{NAME}.png").read_bytes()))
        assert picture.size[0] > 1000
        file.unlink()
        assert main(["--write", str(file)]) == 0
        assert file.read_text(encoding="utf-8") == text
        capsys.readouterr()
        assert main(arguments) == 2
        assert "--resume" in capsys.readouterr().err

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ([], "--out"),
            (["--write", "nowhere.md"], r"nowhere\.json"),
            (["--out", "out", "--sets", "varga7-randm"], "Did you mean 'varga7-random"),
        ],
    )
    def test_what_cannot_be_is_one_line_and_2(self, arguments, message, capsys, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        assert main(arguments) == 2
        err = capsys.readouterr().err
        assert err.startswith("error: ")
        assert err.count("\n") == 1
        assert re.search(message, err)


class TestTree:
    """What lies in docs/: the page follows from the numbers beside it, and they are those of today's code."""

    @pytest.fixture
    def written(self):
        return Measurement.load(DOCS / "pareto.json")

    def test_the_page_says_what_was_measured(self, written):
        assert page(written) == (DOCS / "pareto.md").read_text(encoding="utf-8"), f"docs/pareto.md is stale: {REMEDY}"

    def test_it_has_all_contenders_and_sets(self, written):
        assert {one.name for one in written.sets} == {*test_sets.names(), *fixed()}
        for one in written.sets:
            if one.name in test_sets.names():
                assert one.seeds == test_sets.SETS[one.name].seeds
            assert not one.stale, f"{one.name} has changed since"
            assert [p.spec for p in one.points] == list(plan(one.name, contenders(), 1))
            assert (DOCS / "images" / f"pareto-{one.name}.png").is_file()
        kinds = {family(p.spec)[0] for p in written.sets[0].points if family(p.spec)}
        assert kinds == set(FAMILIES)

    def test_nobody_beats_a_record(self, written):
        for one in written.sets:
            known = one.best_known()
            for point in one.points if known else ():
                for i, cost in enumerate(point.cost):
                    assert cost >= known[i % len(known)] * (1.0 - 2e-6), (one.name, point.spec, i, UPDATE)

    def test_it_is_lean(self):
        assert (DOCS / "pareto.json").stat().st_size < 200_000

    @pytest.mark.parametrize(
        ("name", "spec"), [(NAME, "dls"), (NAME, "rhc:horizon=10,iterations=1"), ("varga7-fast", "rhc:horizon=30")]
    )
    def test_a_part_measured_again(self, written, name, spec):
        (one,) = [one for one in written.sets if one.name == name]
        (then,) = [p for p in one.points if p.spec == spec]
        (row,) = evaluate(name, spec)
        assert row.total_cost == pytest.approx(then.cost[0], rel=1e-4)
