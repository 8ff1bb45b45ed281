"""The foresight page: page and picture follow from numbers, and so does the page in the tree."""

import dataclasses

import pytest

from baselines.evaluation import test_sets
from baselines.evaluation.pages import sets
from baselines.evaluation.pages.entries import SEEDS
from baselines.evaluation.pages.foresight import KNOWING, SHARE, STEPS, entries, page, pictures, spec
from baselines.evaluation.pages.measure import plan
from baselines.evaluation.pages.measurement import Measurement
from tests.baselines.evaluation.pages.builders import DOCS, a_measurement, a_section, complete, point

REMEDY = "write it anew with `python -m baselines.leaderboard --pages foresight --write docs`"


class TestEntries:
    def test_they_look_so_far_ahead(self):
        jobs = plan(sets.MAIN, entries(), 1)
        assert [one.preview for (one,) in jobs.values()] == 2 * [*STEPS]
        assert [one.given["stop_at_end"] for (one,) in jobs.values()] == [True] * 6 + [False] * 6
        assert {one.given["seed"] for (one,) in jobs.values()} == {SEEDS[0]}

    def test_half_of_the_episodes_are_played(self):
        assert {len(jobs) for jobs in plan(sets.MAIN, entries()).values()} == {128}

    def test_the_preset_itself_is_one_of_them(self):
        (whole,) = [one for one in entries() if one.name == spec(3000, knows=True)]
        (job,), (known,) = (next(iter(plan(sets.MAIN, (one,), 1).values())) for one in (whole, of_the_preset()))
        assert job.key == known.key, "what the leaderboard needs, too, is played once"


def of_the_preset():
    return dataclasses.replace(entries()[0], name="rhc_foresight", variants=(("rhc_foresight", {"seed": 0}),))


def lines(*means):
    """Lines that look 100 and 1,500 steps ahead; each knowing the end and not, with costs of two episodes."""
    labels = [spec(ahead, knows=knows) for knows in KNOWING for ahead in (100, 1500)]
    ahead = [100, 1500, 100, 1500]
    points = [point(label, costs, 10.0, 20.0) for label, costs in zip(labels, means, strict=True)]
    return [dataclasses.replace(one, preview=far) for one, far in zip(points, ahead, strict=True)]


class TestPage:
    @pytest.fixture
    def measurement(self, records):
        for name in (sets.MAIN, sets.LONG):
            records(name, {2_000_000: 1.0, 2_000_001: 1.0})
        found = lines([2.0, 8.0], [1.0, 1.0], [3.0, 9.0], [1.1, 1.1])
        return a_measurement(*(a_section(*found, name=name) for name in sets.foresight()))

    def test_what_it_says(self, measurement):
        text = page(measurement)
        assert "- Who looks 100 steps ahead pays 4.000 (2.000 to 8.000) times as much as who looks 1,500 ahead" in text
        assert "- Not to know the end costs 1.100 (1.100 to 1.100) times as much with 1,500 steps of foresight." in text
        assert "1,500 steps cover all 1,000 of the episode." in text
        assert "None of them covers the 3,000 steps of the episode." in text
        assert "| 100 | knows the end | 4.000 | 2.000 … 8.000 | 5.000 | 7.400 | 8.000 | 0 % | 10 | 20 |" in text
        assert "| 1,500 | looks on | 1.100 | 1.100 … 1.100 | 1.100 | 1.100 | 1.100 | 0 % | 10 | 20 |" in text
        assert text.index("| 100 | looks on |") < text.index("| 1,500 | knows the end |")

    def test_picture(self, measurement):
        ((place, figure),) = pictures(measurement)
        assert f"]({place.as_posix()})" in page(measurement)
        assert [axes.get_title(loc="left") for axes in figure.axes] == list(sets.foresight())
        for axes in figure.axes:
            knows, looks_on = (container.lines[0].get_ydata() for container in axes.containers)
            assert list(knows) == pytest.approx([4.0, 1.0])
            assert list(looks_on) == pytest.approx([27.0**0.5, 1.1])
        assert [text.get_text() for text in figure.legends[0].get_texts()] == ["knows the end", "looks on"]


@pytest.mark.skipif(not (DOCS / "foresight.json").exists(), reason="foresight has not been measured yet")
class TestTree:
    @pytest.fixture
    def written(self):
        return Measurement.load(DOCS / "foresight.json")

    def test_the_page_says_what_was_measured(self, written):
        there = (DOCS / "foresight.md").read_text(encoding="utf-8")
        assert page(written) == there, f"docs/foresight.md is stale: {REMEDY}"

    def test_it_has_all_entries_and_sets(self, written):
        complete(written, SHARE)
        assert [one.name for one in written.sections] == list(sets.foresight())
        for one in written.sections:
            known = test_sets.SETS[one.name]
            assert (one.test_set, one.seeds) == (known.digest, known.seeds[: known.episodes // 2])
            assert [line.label for line in one.lines] == [entry.label for entry in entries()]
            assert not one.stale
