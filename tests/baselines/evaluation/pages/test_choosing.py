"""Which solver for my arm: who is named follows from numbers, and so does the page in the tree."""

import dataclasses
import re

import pytest

from baselines import registry
from baselines.evaluation.pages import sets
from baselines.evaluation.pages.choosing.page import OWN, PERIODS, SHARE, entries, page, played, rival
from baselines.evaluation.pages.choosing.situations import (
    COST,
    SITUATIONS,
    chosen,
    largest_error,
    ranked,
    relative_cost,
    standings,
)
from baselines.evaluation.pages.entries import solver
from baselines.evaluation.pages.measure import measure, plan
from baselines.evaluation.pages.measurement import Measurement
from ikgym import arms
from tests.baselines.evaluation.pages.builders import DOCS, a_measurement, a_section, point

MEASURE = "measure anew with `python -m baselines.leaderboard --pages rivals choosing --out …`"
REMEDY = "write it anew with `python -m baselines.leaderboard --pages choosing --write docs`"
TURN = next(one for one in SITUATIONS if "limit stands" in one.name)
RANDOM = next(one for one in SITUATIONS if one.by == COST)
SCENARIOS = tuple(dict.fromkeys(name for one in SITUATIONS for name in one.sets))


def line(name, error, p50=10.0, *, angle=0.0, held=(0, 0, 0), cost=(1.0,)):
    """A solver with errors in [m] and [rad]."""
    found = point(name, cost, p50, 2.0 * p50)
    many = len(cost)
    return dataclasses.replace(found, error=((error,) * many,), angle=((angle,) * many,), held=held)


def sections(situation, *lines, seeds=(0,)):
    return [a_section(*lines, name=name, seeds=seeds) for name in situation.sets]


def labels(found):
    return [one.label for one in found]


class TestStandings:
    def test_the_larger_of_millimetres_and_milliradians(self):
        assert largest_error(line("dls", 0.002, angle=0.005)) == pytest.approx(5.0)
        assert largest_error(line("dls", 0.007, angle=0.005)) == pytest.approx(7.0)
        assert largest_error(dataclasses.replace(line("dls", 0.002), angle=None)) == pytest.approx(2.0)

    def test_the_largest_ratio_of_the_scenarios_decides(self):
        first, second, third = sections(TURN, line("dls", 0.010), line("qp", 0.012))
        third = a_section(line("dls", 0.004), line("qp", 0.002), name=third.name, seeds=(0,))
        found = standings(TURN, [first, second, third])
        assert labels(found) == ["qp", "dls"]
        assert [one.above for one in found] == pytest.approx([1.2, 2.0])
        assert [one.error for one in found] == pytest.approx([12.0, 10.0])

    def test_small_errors_are_as_good_as_none(self):
        found = ranked(sections(TURN, line("qp", 1e-9, 20.0), line("dls", 9e-5, 10.0)), "error")
        assert [one.above for one in found] == [1.0, 1.0]
        assert chosen(found).label == "dls", "the faster one"

    def test_costs_are_those_of_episodes_that_all_have_played(self):
        one = a_section(
            line("dls", 0.0, cost=(2.0, 8.0, 100.0)),
            line("qp", 0.0, cost=(4.0, 2.0)),
            name="panda-random",
            seeds=(0, 1, 2),
        )
        assert relative_cost(one.lines[0], one).tolist() == [[1.0, 4.0]]
        assert relative_cost(one.lines[1], one).tolist() == [[2.0, 1.0]]
        found = ranked([one], COST)
        assert [(s.label, s.cost) for s in found] == [("qp", pytest.approx(2.0**0.5)), ("dls", pytest.approx(2.0))]

    def test_shares_of_steps_and_largest_times(self):
        played = sections(TURN, line("dls", 0.0, held=(29, 0, 58)))
        played[1] = a_section(line("dls", 0.0, 30.0), name=played[1].name, seeds=(0,))
        (found,) = standings(TURN, played)
        steps = sum(sets.get(name).steps for name in TURN.sets)
        assert found.held_back == pytest.approx((2 * 29 / steps, 0.0, 2 * 58 / steps))
        assert (found.p50, found.p99) == (30.0, 60.0)

    def test_who_has_not_played_everything_does_not_stand(self):
        played = sections(TURN, line("dls", 0.0), line("ssik", 0.0))
        played[2] = a_section(line("dls", 0.0), name=played[2].name, seeds=(0,))
        assert labels(standings(TURN, played)) == ["dls"]
        assert standings(TURN, []) == []


class TestChosen:
    def test_the_fastest_of_those_that_are_as_good(self):
        found = standings(TURN, sections(TURN, line("a", 0.0100, 30.0), line("b", 0.0104, 10.0), line("c", 0.011, 1.0)))
        assert chosen(found).label == "b"

    def test_nobody_who_ran_into_a_stop_unless_all_did(self):
        hit, free = line("a", 0.010, held=(1, 0, 0)), line("b", 0.015, held=(0, 9, 9))
        assert chosen(standings(TURN, sections(TURN, hit, free))).label == "b"
        assert chosen(standings(TURN, sections(TURN, hit, line("b", 0.015, held=(5, 0, 0))))).label == "a"

    def test_by_cost(self):
        found = standings(RANDOM, sections(RANDOM, line("a", 0.01, cost=(1.0,)), line("b", 0.0, cost=(3.0,))))
        assert chosen(found, COST).label == "a"


class TestSituations:
    def test_all_families_of_all_arms_are_in_one(self):
        assert set(sets.rivals()) <= set(SCENARIOS)
        assert played() == SCENARIOS
        assert len({one.name for one in SITUATIONS}) == len(SITUATIONS)

    def test_the_model_is_wrong_where_it_says_so(self):
        for name in ("panda-2-circle", "panda-tool-circle"):
            scenario = sets.get(name)
            assert scenario.name == name
            assert scenario.model.name == "panda"
            q = scenario.model.home
            gap = abs(scenario.arm.forward(q)[1] - scenario.model.forward(q)[1]).max()
            assert (gap > 0.15) == (name == "panda-tool-circle")
            assert gap > 1e-4

    def test_limits_are_tighter_where_it_says_so(self):
        for name in sets.GENTLE_PATHS:
            arm = sets.get(name).arm
            assert arm.acceleration_limit == pytest.approx(sets.GENTLE * arms.get("panda").acceleration_limit)
            assert (arm.velocity_limit == arms.get("panda").velocity_limit).all()

    def test_who_plays(self):
        names = [entry.label for entry in entries()]
        assert names[: len(OWN)] == list(OWN)
        assert set(names[len(OWN) :]) == {name for name in registry.names() if registry.get(name).rival}
        assert "ssik" in [entry.label for entry in entries("panda-line")]
        assert "ssik" not in [entry.label for entry in entries("panda-tool-circle")]
        jobs = plan("panda-random", [one for one in entries() if one.label in ("dls", "rhc_foresight")])
        assert [len(some) for some in jobs.values()] == [SHARE * 128] * 2


class TestPage:
    @pytest.fixture
    def text(self):
        some = [line("dls", 0.020, 10.0, held=(29, 0, 0), cost=(9.0,)), line("qp", 0.010, 20.0, cost=(3.0,))]
        some += [line("pink", 0.0102, 200.0, cost=(3.3,))]
        return page(a_measurement(*sections(TURN, *some)))

    def test_the_decision(self, text):
        (row,) = re.findall(r"^\| \[a joint limit stands in the way\]\((#\S+)\) \| (.*) \|$", text, re.MULTILINE)
        assert row[0] == "#a-joint-limit-stands-in-the-way"
        cells = "`qp` | 10.00 | 1.000 | 1.000 | 0, 0, 0 | 20 | 40 | 20.00 | `pink`: 10.20, 1.020, 200"
        assert row[1] == cells
        assert "- Times named: `qp` 1." in text

    def test_ours_stands_beside_one_of_theirs(self):
        text = page(a_measurement(*sections(TURN, line("dls", 0.02), line("pink", 0.01, 200.0))))
        assert "| `pink` | 10.00 | 1.000 | 1.000 | 0, 0, 0 | 200 | 400 | 20.00 | `dls`: 20.00, 2.000, 10 |" in text

    def test_the_details(self, text):
        assert "## A joint limit stands in the way" in text
        table = text.split("## A joint limit stands in the way")[1]
        assert re.findall(r"^\| `(\w+)` ", table, re.MULTILINE) == ["qp", "pink", "dls"]
        steps = sum(sets.get(name).steps for name in TURN.sets)
        assert f"| `dls` | 20.00 | 2.000 | 3.000 | {100 * 87 / steps:.3g}, 0, 0 | 10 | 20 |" in table
        assert "Not played there, since they are not made for it, not installed, or too slow: `null_space`" in table

    def test_by_the_control_period(self, text):
        table = text.split("## By the control period")[1].split("\n## ")[0]
        taken = dict(re.findall(r"^\| ([\d,]+) \| `(\w+)` ", table, re.MULTILINE))
        assert taken == {"25": "dls", **{f"{period:,}": "qp" for period in PERIODS if period >= 50}}

    def test_where_nobody_passes_without_a_stop(self):
        text = page(a_measurement(*sections(TURN, line("dls", 0.02, held=(1, 0, 0)))))
        assert "- Every solver ran into a stop where a joint limit stands in the way." in text

    def test_what_was_not_played_is_not_on_it(self, text):
        assert f"**A trial**: 3 of {len(played())} scenarios were played." in text
        everything = a_measurement(*(a_section(line("dls", 0.1), name=name, seeds=(0,)) for name in played()))
        assert "trial" not in page(everything)
        assert "singular" not in text.split("## Conditions")[0].split("## By what")[1]


def test_it_is_measured(tmp_path):
    """Some solvers on the shortest scenario: errors, limits and times are those of the episode."""
    some = {"choosing": [solver(name, timed=1) for name in ("dls", "qp")]}
    one = measure("tiago-fast", some, tmp_path)["choosing"]
    found = ranked([one], "error")
    assert {s.label for s in found} == {"dls", "qp"}
    assert min(s.above for s in found) == 1.0
    assert all(0.0 < s.p50 <= s.p99 for s in found)
    assert "`tiago-fast`" in page(a_measurement(one))


@pytest.mark.skipif(not (DOCS / "choosing.json").exists(), reason="it has not been measured yet")
class TestTree:
    @pytest.fixture
    def written(self):
        return Measurement.load(DOCS / "choosing.json")

    def test_the_page_says_what_was_measured(self, written):
        there = (DOCS / "choosing.md").read_text(encoding="utf-8")
        assert page(written) == there, f"docs/choosing.md is stale: {REMEDY}"

    def test_it_has_all_situations_and_solvers(self, written):
        if (there := [one.name for one in written.sections]) != list(played()):
            pytest.skip(f"a trial on {len(there)} of {len(played())} scenarios so far: {MEASURE}")
        for one in written.sections:
            assert not one.stale
            own = {entry.name for entry in entries(one.name)} & set(OWN)
            assert {line.label for line in one.lines} >= own
        assert any(rival(line.label) for one in written.sections for line in one.lines)
