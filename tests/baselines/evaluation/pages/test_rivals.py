"""The page of rivals: it follows from numbers, and so does the page in the tree."""

from __future__ import annotations

import dataclasses
import importlib.metadata

import pytest

from baselines import leaderboard, registry
from baselines.evaluation.pages import command, sets
from baselines.evaluation.pages.entries import solver
from baselines.evaluation.pages.measure import measure
from baselines.evaluation.pages.measurement import Measurement
from baselines.evaluation.pages.rivals import BASIS, OURS, entries, page, versions
from ikgym import scenarios
from ikgym.exceptions import MissingDependencyError
from tests.baselines.evaluation.pages.builders import DOCS, a_measurement, a_section, point

REMEDY = "write it anew with `python -m baselines.leaderboard --pages rivals --write docs`"
RIVALS = [name for name in registry.names() if registry.get(name).rival]


def line(name, error, angle, held, p50, unsolved=0):
    """A line with one episode."""
    found = dataclasses.replace(point(name, [1.0], p50, 2.0 * p50), error=((error,),), held=held, unsolved=unsolved)
    return found if angle is None else dataclasses.replace(found, angle=((angle,),))


class TestPage:
    @pytest.fixture
    def text(self):
        first = a_section(
            line("dls", 0.02, 0.1, (700, 0, 30), 10.0),
            line("pink", 5e-7, 2e-6, (0, 0, 0), 100.0, unsolved=3),
            line("mink", 6e-7, 2e-6, (0, 4, 0), 150.0),
            name="panda-circle",
            seeds=(0,),
        )
        second = a_section(
            line("pink", 1e-3, 0.2, (0, 0, 0), 100.0),
            line("dls", 1.04e-3, 0.1, (0, 0, 0), 20.0),
            name="tiago-raster",
            seeds=(0,),
        )
        return page(a_measurement(first, second))

    def test_tables(self, text):
        assert "| `dls` | 20.00 | 0.1000 | 700 | 0 | 30 | 0 | 10 | 20 | 0.1 |" in text
        assert "| `pink` | 0.0005000 | 2.000e-6 | 0 | 0 | 0 | 3 | 100 | 200 | 1 |" in text
        # From the smallest position error on.
        assert text.index("| `pink` | 0.0005000") < text.index("| `mink` | 0.0006000") < text.index("| `dls` | 20.00")
        assert "5,150 steps of 4 ms, task `pose`." in text

    def test_in_short(self, text):
        """Paths, how many of them as well as the best, how many without a limit, median of the relative time."""
        assert "| `dls` | 2 | 1 | 1 | 0.2 |" in text
        assert "| `pink` | 2 | 2 | 2 | 1 |" in text
        assert "| `mink` | 1 | 1 | 0 | 1.5 |" in text

    def test_settings_name_the_package_and_the_solver(self, text):
        (settings,) = [row for row in text.splitlines() if row.startswith("| `pink` | `pin-pink`")]
        assert "`solver = 'quadprog'`" in settings
        assert "`gain = 1.0`" in settings


class TestMeasuring:
    def test_all_paths_of_the_three_arms(self):
        assert {name.partition("-")[0] for name in sets.rivals()} == set(sets.RIVAL_ARMS)
        assert len(sets.rivals()) == 30
        assert not any(scenarios.get(name).random for name in sets.rivals())

    def test_ours_and_theirs(self):
        try:
            names = [one.name for one in entries()]
        except MissingDependencyError as e:
            pytest.skip(str(e))
        assert names[-len(RIVALS) :] == RIVALS
        assert names[: -len(RIVALS)] == [name for name in OURS if name in registry.names()]
        assert all(len(one.variants) == 1 and one.timed == 1 for one in entries())
        assert set(versions()) >= {registry.get(name).distribution for name in RIVALS}

    def test_a_missing_package_is_said_before_anything_is_played(self, monkeypatch, capsys, tmp_path):
        def missing(self=None):
            raise MissingDependencyError("The policy 'pink' needs pin-pink")

        monkeypatch.setattr(registry.get(BASIS), "imported", missing)
        assert leaderboard.main(["--pages", "rivals", "--out", str(tmp_path)]) == 2
        assert "needs pin-pink" in capsys.readouterr().err
        assert not list(tmp_path.iterdir())

    def test_limits_are_kept(self, tmp_path):
        (one,) = measure("tiago-fast", {"rivals": [solver("dls", timed=1)]}, tmp_path)["rivals"].lines
        stop, velocity, acceleration = one.held
        assert stop + velocity + acceleration == 0  # actions mean the velocity limit, and the arm has no acceleration's
        assert one.unsolved == 0
        (one,) = measure("panda-fast", {"rivals": [solver("dls", timed=1)]}, tmp_path)["rivals"].lines
        assert one.held[2] > 100

    def test_only_pages_with_rivals_have_the_versions(self, monkeypatch):
        monkeypatch.setattr(importlib.metadata, "version", {"pin-pink": "4.4", "numpy": "2"}.__getitem__)
        monkeypatch.setattr(importlib.metadata, "PackageNotFoundError", KeyError)
        assert command._machine("rivals")["pin-pink"] == command._machine("choosing")["pin-pink"] == "4.4"
        assert "mink" not in command._machine("rivals")
        assert "pin-pink" not in command._machine("leaderboard")


@pytest.mark.skipif(not (DOCS / "rivals.json").exists(), reason="rivals have not been measured yet")
class TestTree:
    @pytest.fixture
    def written(self):
        return Measurement.load(DOCS / "rivals.json")

    def test_the_page_says_what_was_measured(self, written):
        there = (DOCS / "rivals.md").read_text(encoding="utf-8")
        assert page(written) == there, f"docs/rivals.md is stale: {REMEDY}"

    def test_it_has_all_rivals_and_paths(self, written):
        assert [one.name for one in written.sections] == list(sets.rivals())
        assert {line.name for one in written.sections for line in one.lines} >= {*RIVALS, "dls"}
        assert not any(one.stale for one in written.sections)
