"""The page of the problems from elsewhere follows from numbers, and the page in the tree does."""

from __future__ import annotations

import dataclasses
import math

import pytest

import baselines
from baselines.evaluation.pages.elsewhere import played
from baselines.evaluation.pages.elsewhere.followed import Followed
from baselines.evaluation.pages.elsewhere.page import page
from baselines.evaluation.pages.elsewhere.played import Measured, Run, everybody, run
from baselines.files import ResultsError
from baselines.fingerprints import fingerprint
from ikgym import problems, scenarios
from tests.baselines.evaluation.pages.builders import DOCS

REMEDY = "write it anew with `python -m baselines.evaluation.pages.elsewhere --out docs`"
GOOD = Followed(5e-5, math.radians(0.05), math.radians(2.0), 0.0, 0.0, 30.0)
BAD = dataclasses.replace(GOOD, position_error=0.02, turn=math.radians(9.0))


def measured(*runs):
    return Measured("a command", "2026-01-01", {"cpu": "none"}, runs)


def played_run(problem, who, followed):
    return Run(problem, who, "0", followed, at_stop=3, at_velocity_limit=0, status="converged", time_p50_us=12.3)


@pytest.fixture
def some():
    return measured(
        Run("rlitg-zig", "greedy", "0", BAD),
        played_run("rlitg-zig", "dls", GOOD),
        Run("rlitg-random-000", "greedy", "0", GOOD),
        Run("rlitg-random-001", "greedy", "0", BAD),
        played_run("rlitg-random-000", "dls", BAD),
    )


class TestPage:
    def test_what_it_says(self, some):
        text = page(some)
        assert "- initial trajectory: greedy IK passes on 1 of 3 paths." in text
        assert "- `dls` passes on 1 of 2 paths." in text
        assert "| initial trajectory: greedy IK | no | 20.00 | 0.05000 | 9.000 | – | 0 | 30.00 | – | – | – |" in text
        assert "| `dls` | yes | 0.05000 | 0.05000 | 2.000 | – | 0 | 30.00 | 3 | 0 | 12 |" in text
        assert "`rlitg-zig`\n\n`fetch_arm`, 227 waypoints." in text

    def test_policies_are_compared_on_the_paths_that_all_have_followed(self, some):
        first, rest = page(some).split("The first 1 paths, which everybody has followed:")[1].split("All 2, by those")
        assert "| initial trajectory: greedy IK | 1 of 1 | 0.05000 | 0.05000 |" in first
        assert "| `dls` | 0 of 1 | 20.00 | 20.00 |" in first
        whole = rest.split("## ")[0]
        assert "| initial trajectory: greedy IK | 1 of 2 | 10.03 | 20.00 |" in whole
        assert "dls" not in whole

    def test_what_cannot_be_reached_is_said(self):
        assert "29 of them, 153 to 181 counted from 0, are out of reach of `panda`" in page(
            measured(played_run("cppflow-panda-square", "dls", BAD))
        )

    def test_what_is_saved_is_read(self, some, tmp_path):
        some.save(tmp_path / "x.json")
        assert Measured.load(tmp_path / "x.json") == some
        (tmp_path / "x.json").write_text('{"runs": 3}')
        with pytest.raises(ResultsError, match="Cannot read what was measured from"):
            Measured.load(tmp_path / "x.json")


class TestRun:
    def test_an_initial_trajectory_is_scored_without_an_arm_that_moves(self):
        one = run("rlitg-hello", "cloning")
        assert (one.at_stop, one.at_velocity_limit, one.status, one.time_p50_us) == (None, None, None, None)
        # 64 mm is far, but at the published joint coordinates it is.
        assert one.followed.position_error == pytest.approx(0.0635108, rel=1e-5)

    def test_a_policy_is_played(self, monkeypatch):
        """Its errors at the waypoints are those that the environment reports there."""
        problem = "rlitg-zig"
        short = scenarios.get(problem).replace(steps=200)
        monkeypatch.setattr(played.scenarios, "get", lambda name: short)
        first = problems.waypoints(problem)
        cut = first._replace(positions=first.positions[:21], quaternions=first.quaternions[:21])
        monkeypatch.setattr(played.problems, "waypoints", lambda name: cut)
        one = run(problem, "dls")
        tracked = baselines.track(short, "dls")
        assert one.followed.position_error == pytest.approx(tracked.position_error[9::10].max(), rel=1e-9)
        assert one.followed.orientation_error == pytest.approx(tracked.orientation_error[9::10].max(), rel=1e-6)
        assert one.time_p50_us > 0.0
        assert (one.at_stop, one.at_velocity_limit) == (0, 0)

    def test_everybody(self):
        entered = list(everybody())
        assert len(entered) == len(set(entered)) == 3 * 103 + len(played.POLICIES) * 112
        assert entered[0] == ("rlitg-hello", "greedy")
        assert entered[-1] == ("rlitg-random-099", played.POLICIES[-1])
        fewer = set(entered) - set(everybody(20))
        assert fewer == {(f"rlitg-random-{i:03}", who) for i in range(20, 100) for who in played.COSTLY}


@pytest.mark.skipif(not (DOCS / "elsewhere.json").exists(), reason="it has not been measured yet")
class TestTree:
    @pytest.fixture
    def written(self):
        return Measured.load(DOCS / "elsewhere.json")

    def test_the_page_says_what_was_measured(self, written):
        assert page(written) == (DOCS / "elsewhere.md").read_text(encoding="utf-8"), REMEDY

    def test_scenarios_have_not_changed_since(self, written):
        problems_of = {one.problem: one.fingerprint for one in written.runs}
        assert set(problems_of) == set(problems.NAMES)
        assert {name: fingerprint(scenarios.get(name)) for name in problems_of} == problems_of

    def test_it_is_what_the_command_measures(self, written):
        _, _, paths = written.command.partition(" --paths ")
        assert [(one.problem, one.who) for one in written.runs] == list(everybody(int(paths or 100)))

    def test_scores_of_trajectories_are_worked_out_again(self, written):
        for one in written.runs[:: len(written.runs) // 40]:
            if one.who in problems.METHODS:
                again = run(one.problem, one.who).followed
                for name, value in dataclasses.asdict(again).items():
                    assert value == pytest.approx(getattr(one.followed, name), rel=1e-9, abs=1e-12)
