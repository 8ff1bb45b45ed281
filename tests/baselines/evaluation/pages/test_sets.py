"""What is played, and by whom."""

import pytest

from baselines.evaluation import test_sets
from baselines.evaluation.pages import entries, sets
from baselines.evaluation.pages.entries import playing, shipped, solver, solvers
from baselines.evaluation.pages.measure import plan
from baselines.fingerprints import fingerprint
from ikgym import scenarios
from ikgym.exceptions import UnknownNameError
from tests.baselines.evaluation.pages.builders import fake


class TestSets:
    @pytest.mark.parametrize("main", [sets.MAIN, sets.SKEW])
    def test_what_is_changed(self, main):
        base, larger, faster = map(sets.get, sets.leaderboard(main)[:3])
        assert larger.trajectory.amplitude == pytest.approx(1.2 * base.trajectory.amplitude)
        assert larger.trajectory.frequency == base.trajectory.frequency == (1.0, 3.0)
        assert faster.trajectory.frequency == (1.0, 4.0)
        assert larger.task is faster.task is base.task
        assert len({fingerprint(sets.get(name)) for name in sets.leaderboard(main)}) == 4
        assert [sets.get(name).name for name in sets.leaderboard(main)] == list(sets.leaderboard(main))
        assert not {larger.name, faster.name} & set(scenarios.names())

    def test_unknown(self):
        with pytest.raises(UnknownNameError, match="Did you mean 'varga7-fast'"):
            sets.get("varga7-fst")

    def test_who_plays_what(self):
        everyone = [fake(dampings=(1e-2, 2e-2)), *solvers()]
        assert list(plan(sets.SKEW, everyone, 1)) == [entry.label for entry in everyone]
        main_set = plan(sets.MAIN, [*everyone, *shipped()], 1)
        # On whole poses there is no orientation to be resolved.
        suited = [entry.label for entry in everyone if not entry.name.startswith("full_orientation")]
        assert list(main_set) == [*suited, "agent_alone", "agent_ppo", "agent_residual"]
        jobs = plan("varga7-random-amplitude", playing("varga7-random-amplitude", everyone, sets.SKEW))
        assert set(jobs) == {"fake", *entries.GENERAL}
        assert [len(jobs[name]) for name in ("fake", "dls", entries.FORESIGHT)] == [64, 32, 96]
        assert not any(job.timed or job.first for of in jobs.values() for job in of)
        assert {job.seed for job in jobs["dls"]} == set(scenarios.seeds("test", 32))
        assert [len(of) for of in plan("varga7-fast", everyone[:1]).values()] == [2]

    def test_test_set_as_a_whole(self):
        jobs = plan(sets.MAIN, [fake()])["fake"]
        assert len(jobs) == 3 * 256
        assert {job.test_set for job in jobs} == {test_sets.SETS[sets.MAIN].digest}

    def test_who_takes_too_long_plays_the_first_ones(self):
        jobs = plan(sets.MAIN, [solver("dls"), solver("rhc:horizon=100")])
        assert [len(of) for of in jobs.values()] == [256, 32]
        assert [job.seed for job in jobs["rhc:horizon=100"]] == list(test_sets.SETS[sets.MAIN].seeds[:32])
        assert [len(of) for of in plan(sets.MAIN, [solver("rhc:horizon=100")], 5).values()] == [5]
        assert [len(of) for of in plan("varga7-fast", [solver("rhc:horizon=100")]).values()] == [1]

    def test_who_does_not_suit_is_left_out(self):
        some = [solver("dls"), solver("follow_nominal")]
        assert list(plan("khan8-q1", some)) == ["dls", "follow_nominal"]
        assert list(plan("zhang3-helix", some)) == ["dls"]

    def test_fixed_scenarios(self):
        assert {"varga7-fast", "varga7-slow", "faitli3-regular", "zhang3-helix"} <= set(sets.cost_time())
        assert sets.cost_time()[:2] == sets.foresight() == test_sets.names()[:2] == (sets.MAIN, sets.LONG)
        assert sets.SKEW not in sets.cost_time()
        assert "khan8-q1" not in sets.cost_time()
