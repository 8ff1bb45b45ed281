"""The cost–time page: page and plots follow from numbers, and so does the page in the tree."""

import dataclasses
import re

import pytest
from matplotlib.text import Text

from baselines.evaluate import evaluate
from baselines.evaluation import test_sets
from baselines.evaluation.pages import sets
from baselines.evaluation.pages.cost_time import front, page, pictures
from baselines.evaluation.pages.families import FAMILIES, entries, family
from baselines.evaluation.pages.measure import plan
from baselines.evaluation.pages.measurement import Measurement
from baselines.oracle import best_known
from baselines.oracle.best_known import UPDATE
from tests.baselines.evaluation.pages.builders import DOCS, a_measurement, a_section, complete, point

REMEDY = "write it anew with `python -m baselines.leaderboard --write docs`"
NAME = sets.MAIN


def test_front(records):
    records(NAME, {2_000_000: 1.0})
    points = [
        point("dls", [9.0], 1.0, 60.0),
        point("mfac", [9.0], 2.0, 50.0),
        point("broyden", [5.0], 2.0, 70.0),
        point("mfapc", [5.0], 3.0, 40.0),
        point("rhc", [2.0], 9.0, 30.0),
        point("smoothed", [3.0], 10.0, 20.0),
        dataclasses.replace(point("null_space", [1.0]), time_p50_us=None, time_p99_us=None),
    ]
    one = a_section(*points, seeds=(2_000_000,))
    assert front(one) == ["dls", "broyden", "rhc"]
    assert front(one, "time_p99_us") == ["smoothed", "rhc"]


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
        return a_measurement(a_section(*points))

    def test_what_it_says(self, measurement):
        text = page(measurement)
        lines = text.splitlines()
        (of_dls,) = [line for line in lines if line.startswith("| ● | `dls`")]
        # Geometric mean and its interval, median, p90 and worst, the share lost, times, episodes.
        assert of_dls == "| ● | `dls` | 60.00 | 40.00 … 90.00 | 65.00 | 85.00 | 90.00 | 50 % | 15 | 20 | 30 | 2 | 1 |"
        assert any(line.startswith("| ● | `broyden`") for line in lines)
        assert any(line.startswith("|  | `mfac` | 79.37 |") for line in lines)
        assert "`rhc_foresight` by +10.0 % (+10.0 % to +10.0 %) in the geometric mean, by +10.0 % in the median" in text
        choice = text.split("## How to choose")[1].split("| horizon |")[0]
        chosen = re.findall(r"\| (\d+) \| `(\S+)`", choice)
        assert chosen == [
            ("20", "dls"),
            ("27", "rhc:horizon=3"),
            ("60", "rhc:horizon=30,iterations=1"),
            ("120", "rhc_foresight:stop_at_end=True"),
        ]
        assert "| 30 | 1.300 | 1.300 … 1.300 | 180 | – | – | – | 1.333 | 1.333 … 1.333 | 50 | – | – | – |" in text
        assert "- date: 2000-01-01" in lines

    def test_who_has_played_fewer_is_marked_and_not_on_the_front(self, measurement):
        (one,) = measurement.sections
        fewer = dataclasses.replace(one.lines[0], cost=((1.0,),))
        text = page(
            dataclasses.replace(measurement, sections=(dataclasses.replace(one, lines=(fewer, *one.lines[1:])),))
        )
        assert (
            "|  | `dls` | 1.000 | 1.000 … 1.000 | 1.000 | 1.000 | 1.000 | 100 % | 15 | 20 | 30 | **1 × 1** | 1 |"
            in text
        )
        assert "They play the" not in page(measurement)
        assert "they play the first 12.5 % of the episodes" in text

    def test_seeds_are_counted(self, measurement):
        (one,) = measurement.sections
        preset = point("rhc_foresight:stop_at_end=True", [2.0] * 6, seeds=(0, 1, 2))
        text = page(dataclasses.replace(measurement, sections=(dataclasses.replace(one, lines=(preset,)),)))
        assert "| 3 × 2 | 1 |" in text

    def test_pictures(self, measurement):
        ((place, figure),) = pictures(measurement)
        assert f"]({place.as_posix()})" in page(measurement)
        assert figure.axes[0].get_ylabel() == "cost ratio [1], geometric mean"
        handles = figure.legends[0].legend_handles
        assert len({handle.get_color() for handle in handles[:2]}) == 2, "a colour for each family"
        figure.draw_without_rendering()
        renderer = figure.canvas.get_renderer()
        texts = figure.axes[0].texts
        names = {t.get_text() for t in texts}
        assert {"dls", "broyden", "3", "400", "rhc_foresight, stop_at_end on", "deadline, 1 ms"} <= names
        listed = [t.get_text() for t in figure.legends[1].get_texts()]
        presets = [f"rhc_foresight, stop_at_end {knows}" for knows in ("on", "off")]
        assert listed == ["dls", "broyden", "mfac", *presets]
        handles = figure.legends[1].legend_handles
        assert len({handle.get_marker() for handle in handles}) == 5, "a marker for each policy"
        boxes = [Text.get_window_extent(t, renderer) for t in texts]
        for number, box in enumerate(boxes):
            assert not any(box.overlaps(other) for other in boxes[:number]), texts[number].get_text()

    def test_costs_where_no_cost_ratio_is_known(self, measurement, monkeypatch, tmp_path):
        monkeypatch.setattr(best_known, "DATA", tmp_path / "none.json")
        ((_, figure),) = pictures(measurement)
        assert figure.axes[0].get_ylabel() == "cost relative to rhc_foresight [1], geometric mean"
        assert "| policy | cost relative to rhc_foresight | 95 % | median |" in page(measurement)


class TestTree:
    """What lies in docs/: the page follows from the numbers beside it, and they are those of today's code."""

    @pytest.fixture
    def written(self):
        return Measurement.load(DOCS / "cost_time.json")

    def test_the_page_says_what_was_measured(self, written):
        assert page(written) == (DOCS / "cost_time.md").read_text(encoding="utf-8"), (
            f"docs/cost_time.md is stale: {REMEDY}"
        )

    def test_it_has_all_entries_and_sets(self, written):
        complete(written)
        assert [one.name for one in written.sections] == list(sets.cost_time())
        for one in written.sections:
            if one.name in test_sets.names():
                known = test_sets.SETS[one.name]
                assert (one.test_set, one.seeds) == (known.digest, known.seeds)
            assert not one.stale, f"{one.name} has changed since"
            assert [line.label for line in one.lines] == list(plan(one.name, entries(), 1))
            assert (DOCS / "images" / f"cost-time-{one.name}.png").is_file()
        kinds = {family(line.name)[0] for line in written.sections[0].lines if family(line.name)}
        assert kinds == set(FAMILIES)

    def test_nobody_beats_a_record(self, written):
        for one in written.sections:
            known = one.best_known
            for line in one.lines if known else ():
                for costs in line.cost:
                    for i, cost in enumerate(costs):
                        assert cost >= known[i] * (1.0 - 2e-6), (one.name, line.label, i, UPDATE)

    def test_it_is_lean(self):
        assert (DOCS / "cost_time.json").stat().st_size < 500_000  # costs, errors and angles of 256 episodes a line

    @pytest.mark.parametrize(
        ("name", "spec"), [(NAME, "dls"), (NAME, "rhc:horizon=10,iterations=1"), ("varga7-fast", "rhc:horizon=30")]
    )
    def test_a_part_measured_again(self, written, name, spec):
        complete(written)
        (one,) = [one for one in written.sections if one.name == name]
        (then,) = [line for line in one.lines if line.label == spec]
        (row,) = evaluate(name, spec)
        assert row.total_cost == pytest.approx(then.cost[0][0], rel=1e-4)
