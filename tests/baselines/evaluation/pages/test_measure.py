"""Lines are what an evaluation gives, whoever is entered and however often it is started."""

import numpy as np
import pytest

from baselines.agents.features import Processing
from baselines.agents.files import save_agent
from baselines.agents.network import Network
from baselines.evaluate import evaluate
from baselines.evaluation import test_sets
from baselines.evaluation.pages import sets
from baselines.evaluation.pages.entries import Entry, agents, playing, solver
from baselines.evaluation.pages.measure import measure, plan, play
from baselines.evaluation.pages.measurement import RESIDUAL
from baselines.files import ResultsError
from baselines.policy import Problem
from baselines.workers import Workers
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from tests.baselines.evaluation.pages.builders import KNOWN, TEST_SEEDS, fake, write_runs
from tests.baselines.losing import LosingCluster

FEW = (
    fake(),
    solver("dls"),
    solver("dls", {"gain": 0.5}),
    Entry("rhc_foresight", (("rhc_foresight", {"seed": 0}), ("rhc_foresight", {"seed": 1})), (0, 1), timed=1),
)
SEEDED = "rhc_foresight:stop_at_end=True"
COMPARED = (
    solver("dls", timed=1),
    solver("rhc:horizon=3,iterations=1", timed=1),
    Entry(SEEDED, tuple(("rhc_foresight", {"stop_at_end": True, "seed": seed}) for seed in (0, 4)), (0, 4), timed=2),
)
PAGES = {"leaderboard": FEW[:3], "cost-time": COMPARED}


def write_agent(folder, scenario, seed):
    """An agent that adds next to nothing to damped least squares."""
    rng, where, processing = (
        np.random.default_rng(seed),
        scenarios.get(scenario),
        Processing(base_policy="dls", action_scale=1e-4),
    )
    sizes = ((where.joints, processing.size(Problem.of(where))),)
    weights = tuple(rng.normal(size=size).astype(np.float32) for size in sizes)
    network = Network(weights, (np.zeros(where.joints, dtype=np.float32),))
    save_agent(folder / "agent.safetensors", network, processing, where)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("pages")


@pytest.fixture(scope="module")
def both(out):
    return measure(sets.MAIN, PAGES, out, episodes=2)


@pytest.fixture(scope="module")
def played(both):
    return both["leaderboard"]


class TestMeasure:
    def test_lines_are_what_an_evaluation_gives(self, played):
        assert [one.label for one in played.lines] == ["fake", "dls", "dls, tuned"]
        rows = evaluate(
            sets.MAIN, [*(f"dls:damping={d}" for d in (1e-2, 2e-2, 3e-2)), "dls", "dls:gain=0.5"], episodes=2
        )
        costs = np.array([row.total_cost for row in rows]).reshape(5, 2)
        assert np.array(played.lines[0].cost) == pytest.approx(costs[:3], rel=1e-6)
        assert np.array(played.lines[1].cost) == pytest.approx(costs[3:4], rel=1e-6)
        assert np.array(played.lines[2].cost) == pytest.approx(costs[4:], rel=1e-6)
        errors = np.array([row.position_error_max for row in rows]).reshape(5, 2)
        assert np.array(played.lines[0].error) == pytest.approx(errors[:3], rel=1e-3)
        assert played.cost_ratios()["fake"] == pytest.approx(costs[:3] / KNOWN, rel=1e-6)
        assert [one.timed for one in played.lines] == [6, 2, 2]
        for one in played.lines:
            assert 0.0 < one.time_p50_us <= one.time_p99_us
        assert played.seeds == TEST_SEEDS[:2]
        assert not played.stale

    def test_what_is_done_is_not_done_again(self, both, out, monkeypatch):
        monkeypatch.setattr("baselines.evaluation.runner.play", lambda *_: pytest.fail("played again"))
        assert measure(sets.MAIN, PAGES, out, episodes=2, resume=True) == both
        with pytest.raises(ResultsError, match="--resume"):
            measure(sets.MAIN, PAGES, out, episodes=2)

    def test_a_cluster_plays_what_is_not_timed(self, monkeypatch):
        pool = LosingCluster(monkeypatch, lost=[0])
        plans = plan("varga7-pose-random-frequency", [solver("dls", timed=1)], 3)
        (there,) = play(plans, workers=Workers(cluster="ray")).values()
        (here,) = play(plans).values()
        assert [row.total_cost for row in there] == [row.total_cost for row in here]
        assert [row.time_p50_us is None for row in there] == [False, True, True]
        assert [len(unit.jobs) for unit in pool.units] == [2, 2]

    def test_changed_scenarios_are_relative_to_foresight(self, out):
        there = playing("varga7-pose-random-frequency", FEW[1:])
        found = measure("varga7-pose-random-frequency", {"page": there}, out, episodes=1)["page"]
        assert found.best_known is None
        cost_ratios = found.cost_ratios()
        assert cost_ratios["rhc_foresight"].min() == 1.0 < cost_ratios["rhc_foresight"].max()
        assert cost_ratios["dls"][0, 0] == found.lines[0].cost[0][0] / min(cost for (cost,) in found.lines[2].cost)
        assert found.lines[0].time_p50_us is None
        (row,) = evaluate(sets.get("varga7-pose-random-frequency"), "dls")
        assert found.lines[0].cost[0][0] == pytest.approx(row.total_cost, rel=1e-6)

    def test_agents_from_their_files(self, tmp_path):
        write_runs(tmp_path / "mine", 2, base_policy="dls")
        write_runs(tmp_path / "other", 1, base_policy="dls")
        for seed in range(2):
            write_agent(tmp_path / "mine" / f"seed-{seed}", "varga7-random", seed)
        write_agent(tmp_path / "other" / "seed-0", "zhang6-lspb", 0)
        (mine,) = agents([f"mine={tmp_path / 'mine'}"])
        (found,) = measure("varga7-fast", {"page": [mine]}, tmp_path / "out")["page"].lines
        assert (found.kind, found.preview, found.seeds, np.shape(found.cost)) == (RESIDUAL, 240, (0, 1), (2, 1))
        assert found.cost[0] != found.cost[1]
        write_agent(tmp_path / "mine" / "seed-1", "varga7-random", 5)
        (again,) = measure("varga7-fast", {"page": [mine]}, tmp_path / "out", resume=True)["page"].lines
        assert again.cost[0] == found.cost[0]
        assert again.cost[1] != found.cost[1], "another agent in the same file is played again"
        with pytest.raises(InvalidInputError, match="other: made for another task or arm than that of varga7-random"):
            plan(sets.SKEW, [mine, *agents([f"other={tmp_path / 'other'}"])], 1)

    def test_seeds_of_a_policy_follow_each_other(self, both):
        compared = both["cost-time"]
        assert [line.label for line in compared.lines] == [entry.label for entry in COMPARED]
        assert compared.seeds == TEST_SEEDS[:2]
        assert not compared.stale
        rows = evaluate(sets.MAIN, ["dls", "rhc_foresight:seed=0", "rhc_foresight:seed=4"], episodes=2)
        costs = np.array([row.total_cost for row in rows]).reshape(3, 2)
        assert np.array(compared.lines[0].cost) == pytest.approx(costs[:1], rel=1e-6)
        assert np.array(compared.lines[2].cost) == pytest.approx(costs[1:], rel=1e-6)
        assert compared.lines[2].cost[0] != compared.lines[2].cost[1]
        assert compared.lines[0].lost == sum(row.lost for row in rows[:2])
        assert compared.lines[0].angle[0] == pytest.approx([row.orientation_error_max for row in rows[:2]], rel=1e-3)

    def test_so_many_are_timed(self, both):
        # Both are timed of `dls`, for the other page's sake: what two pages ask for is played once.
        assert [line.timed for line in both["cost-time"].lines] == [2, 1, 4]
        for line in both["cost-time"].lines:
            assert 0.0 < line.time_p50_us <= line.time_p99_us

    def test_what_both_pages_need_is_the_same_episode(self, both):
        assert both["leaderboard"].lines[1] == both["cost-time"].lines[0]

    def test_jobs_belong_to_the_test_set(self):
        jobs = plan(sets.MAIN, COMPARED)
        assert {job.test_set for of in jobs.values() for job in of} == {test_sets.SETS[sets.MAIN].digest}
        assert [len(of) for of in jobs.values()] == [256, 256, 512]
