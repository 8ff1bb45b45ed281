"""The leaderboard: page and plots follow from numbers, and so does the page in the tree."""

import dataclasses
import json
import re

import pytest
from matplotlib.text import Text

from baselines.evaluate import evaluate
from baselines.evaluation import test_sets
from baselines.evaluation.pages import sets
from baselines.evaluation.pages import tuning as tunings
from baselines.evaluation.pages.entries import shipped, solvers
from baselines.evaluation.pages.leaderboard import page, pictures, profiled
from baselines.evaluation.pages.measure import plan
from baselines.evaluation.pages.measurement import Measurement
from baselines.evaluation.pages.tuning import Tuned, Tuning
from baselines.fingerprints import fingerprint
from ikgym import scenarios
from tests.baselines.evaluation.pages.builders import (
    DOCS,
    TEST_SEEDS,
    a_measurement,
    a_section,
    complete,
    learned,
    line,
)

REMEDY = "write it anew with `python -m baselines.leaderboard --write docs`"


@pytest.fixture
def tuning():
    solver = Tuned("dls", {"gain": 0.5}, 7, 4.0, 2.0)
    digest = fingerprint(scenarios.get(sets.MAIN))
    return Tuning("a command", "2000-01-01", sets.MAIN, digest, "validation", 4, (solver,))


class TestPage:
    @pytest.fixture
    def measurement(self):
        fast = [row.total_cost for row in evaluate("varga7-fast", "dls", steps=3000)]
        place = a_section(
            dataclasses.replace(line(), cost=((fast[0],),), error=((0.1,),), lost=1), seeds=(0,), name="varga7-fast"
        )
        return a_measurement(
            a_section(
                line("dls", ((2.0, 8.0),), error=0.009),
                line("dls", ((2.0, 2.0),), settings={"gain": 0.5}),
                line("rhc_foresight", ((1.0, 1.0), (1.0, 1.21)), preview=1500, seeds=(0, 1)),
                learned("PPO", ((3.0, 12.0),) * 5, error=0.06),
                learned("few", ((1.1, 1.1),) * 2, base_policy="dls"),
            ),
            place,
        )

    def test_what_it_says(self, measurement, tuning):
        lines = page(measurement, tuning).splitlines()
        rows = [cells for text in lines if len(cells := [cell.strip() for cell in text.strip("|").split("|")]) == 16]
        table = {cells[0].strip("*"): cells for cells in rows}
        assert [*table][2:] == ["`oracle`", "`rhc_foresight`", "few", "`dls`, tuned", "`dls`", "PPO"]
        kind, ahead, cost_ratio, _, median, p90, worst, ten, one, lost, p50, p99, seeds, steps, cost = table["`dls`"][
            1:
        ]
        assert (kind, ahead, cost_ratio, median, p90, worst) == ("solver", "1", "4.000", "5.000", "7.400", "8.000")
        assert (ten, one, lost, p50, p99, seeds) == ("100 %", "0 %", "0 %", "10", "20", "deterministic")
        assert (steps, cost) == ("–", "–")
        assert table["PPO"][:4] == ["**PPO**", "agent", "240", "**6.000**"]
        assert table["PPO"][10:] == ["100 %", "10", "20", "5", "1.000e6", "12.00"]
        assert table["few"][13] == "2 seeds: not a benchmark"
        assert table["few"][0] == "**few**"
        assert table["`rhc_foresight`"][13] == "2 of the policy"
        assert table["`dls`, tuned"][:4] == ["**`dls`, tuned**", "solver, tuned", "1", "**2.000**"]
        assert table["`dls`"][0] == "`dls`"
        low, high = map(float, table["`dls`"][4].split(" … "))
        assert (low, high) == (2.0, 8.0)

    def test_generalisation_and_tuning(self, measurement, tuning):
        text = page(measurement, tuning)
        assert "- `varga7-fast`: the fast trajectory of Varga 2021, 3,000 steps; 1 episode; cost ratios." in text
        (row,) = evaluate("varga7-fast", "dls")
        (found,) = [
            text for text in text.splitlines() if text.startswith("| `dls` | solver | ") and "100 %" in text[-9:]
        ]
        assert float(found.split("|")[3]) == pytest.approx(row.cost_ratio, rel=1e-3)
        assert "| `dls` | `gain=0.5` | 7 | 4.000 | 2.000 | 0.5000 |" in text
        assert "the first 4 validation episodes" in text

    def test_nothing_was_searched(self, measurement, tuning):
        text = page(measurement, dataclasses.replace(tuning, command="python -m x", solvers=()))
        assert "No settings have been searched for this scenario: `python -m x`." in text

    def test_pictures(self, measurement, tuning):
        text, drawn = page(measurement, tuning), dict(pictures(measurement))
        assert [place.name for place in drawn] == ["leaderboard-means.png", "leaderboard-profiles.png"]
        for place in drawn:
            assert f"]({place.as_posix()})" in text
        means, profiles = drawn.values()
        names = [text.get_text() for text in means.axes[0].get_yticklabels()]
        assert names == [
            "oracle (best known)",
            "rhc_foresight",
            "few (2 seeds: not a benchmark)",
            "dls, tuned",
            "dls",
            "PPO",
        ]
        curves = {text.get_text() for text in profiles.legends[0].get_texts()}
        assert curves == {*names[1:]}

    def test_no_names_overlap(self, measurement):
        many = [line(f"solver_{k}", ((1.0 + k, 9.0**k),)) for k in range(40)]
        (_, means), (_, profiles) = pictures(a_measurement(a_section(*many)))
        for drawn in (means, profiles):
            drawn.draw_without_rendering()
            renderer = drawn.canvas.get_renderer()
            texts = [*drawn.axes[0].get_yticklabels(), *drawn.axes[0].texts]
            boxes = [Text.get_window_extent(text, renderer) for text in texts if text.get_text()]
            for number, box in enumerate(boxes):
                assert not any(box.overlaps(other) for other in boxes[:number]), texts[number].get_text()

    def test_a_few_solvers_have_profiles_and_all_agents(self):
        many = [line(f"solver_{k}", ((1.0 + k, 1.0),)) for k in range(9)]
        shown = profiled(a_section(*many, *(learned(f"agent_{k}", ((9.0, 9.0),)) for k in range(3))))
        assert [one.name for one in shown] == [*(f"solver_{k}" for k in range(5)), *(f"agent_{k}" for k in range(3))]


@pytest.mark.skipif(not (DOCS / "leaderboard.json").exists(), reason="no leaderboard has been measured yet")
class TestTree:
    """What lies in docs/: the page follows from the numbers beside it, and they are those of today's code."""

    @pytest.fixture
    def written(self):
        return Measurement.load(DOCS / "leaderboard.json")

    def test_the_page_says_what_was_measured(self, written):
        there = (DOCS / "leaderboard.md").read_text(encoding="utf-8")
        assert page(written, tunings.of(sets.MAIN)) == there, f"docs/leaderboard.md is stale: {REMEDY}"

    def test_it_has_all_solvers_and_sets(self, written):
        complete(written)
        assert [one.name for one in written.sections] == list(sets.leaderboard())
        main_set = written.sections[0]
        assert (main_set.test_set, main_set.seeds) == (test_sets.SETS[sets.MAIN].digest, TEST_SEEDS)
        assert not [one.name for one in written.sections if one.stale]
        found = {one.label: one.settings for one in main_set.lines if not one.learned}
        entered = solvers(tunings.of(sets.MAIN).settings)
        suited = plan(sets.MAIN, entered, 1)
        assert found == {e.label: json.loads(json.dumps(e.settings)) for e in entered if e.label in suited}

    def test_agents_are_those_of_the_package_and_whole_trainings(self, written):
        learned = {one.name: one for one in written.sections[0].lines if one.learned}
        assert learned.keys() >= {one.name for one in shipped()}
        assert all(learned[name].benchmark for name in learned.keys() - {one.name for one in shipped()})

    def test_it_names_no_folder_of_a_machine(self, written):
        assert not re.search(r"(^|[\s=])/", written.command)

    def test_a_part_measured_again(self, written):
        (then,) = [one for one in written.sections[0].lines if one.label == "dls"]
        rows = evaluate(sets.MAIN, "dls", episodes=2)
        assert [row.total_cost for row in rows] == pytest.approx(then.cost[0][:2], rel=1e-4)


class TestSkew:
    """The page on skew coordinates follows from what was measured for the test sets of version 0.2.0."""

    def test_the_page_says_what_was_measured(self):
        written = Measurement.load(DOCS / "leaderboard_skew.json")
        assert [one.name for one in written.sections] == list(sets.leaderboard(sets.SKEW))
        there = (DOCS / "leaderboard_skew.md").read_text(encoding="utf-8")
        assert page(written, tunings.of(sets.SKEW), "leaderboard-skew") == there, REMEDY
        assert "64 test episodes" in there
        assert "at some time" in there
        assert "rad, at some time" not in there, "angles were not kept then"
        for place, _ in pictures(written, "leaderboard-skew"):
            assert (DOCS / place).is_file()
