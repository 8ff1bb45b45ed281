"""The leaderboard: its statistics, its tuning on validation episodes, and that page and plots follow from numbers."""

import dataclasses
import io
import json
import pathlib
import re

import numpy as np
import PIL.Image
import pytest
import scipy.stats
from matplotlib.text import Text

from baselines import registry
from baselines.agents.features import Processing
from baselines.agents.files import save_agent
from baselines.agents.network import Network
from baselines.agents.policy import LearnedPolicy
from baselines.evaluate import evaluate
from baselines.evaluation import test_sets
from baselines.evaluation.leaderboard import __main__ as command
from baselines.evaluation.leaderboard import entries, places, statistics
from baselines.evaluation.leaderboard.__main__ import main
from baselines.evaluation.leaderboard.board import AGENT, FAR, NEAR, RESIDUAL, Board, Line, Section
from baselines.evaluation.leaderboard.claims import Comparison, sentences
from baselines.evaluation.leaderboard.entries import Entry, Training, agents, solvers
from baselines.evaluation.leaderboard.grids import GRIDS, decades, product
from baselines.evaluation.leaderboard.measure import measure, plan
from baselines.evaluation.leaderboard.page import page, pictures, profiled
from baselines.evaluation.leaderboard.statistics import interval, profile
from baselines.evaluation.leaderboard.tuning import DATA, EPISODES, UPDATE, Tuned, Tuning, tune
from baselines.files import ResultsError
from baselines.fingerprints import fingerprint
from baselines.oracle import best_known
from baselines.policy import Problem
from baselines.spec import parse_policy
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, MissingDependencyError, UnknownNameError

DOCS = pathlib.Path(__file__).parents[3] / "docs"
REMEDY = "draw it up again with `python -m baselines.leaderboard --write docs/leaderboard.md`"
TEST_SEEDS = test_sets.SETS[places.MAIN].seeds
KNOWN = [best_known.cost(scenarios.get(places.MAIN), seed) for seed in TEST_SEEDS[:2]]


def fake(name="fake", dampings=(1e-2, 2e-2, 3e-2), *, base_policy=None, method="ppo"):
    """An agent whose training seeds are solvers."""
    count = len(dampings)
    training = Training(method, base_policy, tuple(1000 * (k + 1) for k in range(count)), (1.5,) * count)
    return Entry(name, tuple(("dls", {"damping": d}) for d in dampings), tuple(range(count)), training=training)


def line(name="dls", cost_ratios=((2.0, 8.0),), *, preview=1, seeds=(), error=0.0005, settings=(), training=None):
    """A line with these cost ratios in the first episodes of the main set."""
    cost = tuple(tuple(r * k for r, k in zip(row, KNOWN, strict=True)) for row in cost_ratios)
    errors = tuple(tuple(error for _ in row) for row in cost_ratios)
    return Line(name, dict(settings), preview, seeds, cost, errors, 1, 10.0, 20.0, 30.0, training)


def learned(name, cost_ratios, *, base_policy=None, **others):
    count = len(cost_ratios)
    training = Training("ppo", base_policy, (1_000_000,) * count, (12.0,) * count)
    return line(name, cost_ratios, seeds=tuple(range(count)), preview=240, training=training, **others)


def a_section(*lines, seeds=TEST_SEEDS[:2], name=places.MAIN):
    return Section(name, fingerprint(places.get(name)), None, seeds, lines)


def a_board(*sections):
    return Board("a command", "2000-01-01", {"cpu": "a machine"}, sections)


@pytest.fixture
def tuning():
    solver = Tuned("dls", {"gain": 0.5}, 7, 4.0, 2.0)
    digest = fingerprint(scenarios.get(places.MAIN))
    return Tuning("a command", "2000-01-01", places.MAIN, digest, "validation", 4, (solver,))


class TestInterval:
    def test_one_seed_is_the_one_level_bootstrap_of_scipy(self):
        values = np.random.default_rng(1).lognormal(size=40)
        for statistic in (np.mean, np.median):
            expected = scipy.stats.bootstrap(
                (values,), statistic, method="percentile", n_resamples=999, random_state=np.random.default_rng(5)
            ).confidence_interval
            assert interval(values[None], statistic, resamples=999, seed=5) == pytest.approx(tuple(expected))

    def test_one_episode_is_that_over_seeds(self):
        values = np.random.default_rng(1).normal(size=(9, 1))
        assert interval(values, resamples=999) == interval(values.T, resamples=999)

    def test_one_run_has_no_width(self):
        assert interval(np.array([[3.0]])) == (3.0, 3.0)

    def test_many_episodes_come_to_the_normal_interval(self):
        values = np.random.default_rng(2).normal(size=(1, 400))
        half = 1.96 * values.std() / 20.0
        low, high = interval(values)
        assert (low, high) == pytest.approx((values.mean() - half, values.mean() + half), abs=0.1 * half)

    def test_variances_of_both_levels_add_up(self):
        rng = np.random.default_rng(3)
        of_seed, of_episode = rng.normal(size=(50, 1)), 2.0 * rng.normal(size=(1, 60))
        low, high = interval(of_seed + of_episode, resamples=2000)
        deviation = np.sqrt(of_seed.var() / 50 + of_episode.var() / 60)
        assert high - low == pytest.approx(2 * 1.96 * deviation, rel=0.1)

    def test_wider_where_seeds_differ(self):
        rng = np.random.default_rng(4)
        alike = np.tile(rng.normal(size=(1, 64)), (5, 1))
        low, high = interval(alike, resamples=999)
        wide = interval(alike + 2.0 * rng.normal(size=(5, 1)), resamples=999)
        assert wide[1] - wide[0] > 2.0 * (high - low)

    def test_seeds_that_are_alike_say_nothing_new(self):
        """Episodes are drawn for all seeds together: five copies of a seed are one, not five times the episodes."""
        one = np.random.default_rng(6).normal(size=(1, 64))
        alone, five = interval(one, resamples=4000), interval(np.tile(one, (5, 1)), resamples=4000)
        assert five[1] - five[0] == pytest.approx(alone[1] - alone[0], rel=0.1)

    def test_same_numbers_same_interval(self):
        values = np.random.default_rng(7).normal(size=(3, 8))
        assert interval(values) == interval(values.copy())
        assert interval(values) != interval(values, seed=1)

    def test_covers_once(self):
        low, high = interval(np.random.default_rng(8).normal(size=(10, 64)), resamples=999)
        assert low < 0.0 < high

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("seeds", "of_seed", "of_episode", "least"), [(10, 0.3, 1.0, 0.9), (1, 0.0, 1.0, 0.9), (5, 1.0, 0.1, 0.75)]
    )
    def test_coverage_of_the_mean_logarithm_of_lognormal_cost_ratios(self, seeds, of_seed, of_episode, least):
        rng, hits, trials = np.random.default_rng(9), 0, 300
        for trial in range(trials):
            cost_ratios = np.exp(of_seed * rng.normal(size=(seeds, 1)) + of_episode * rng.normal(size=(1, 64)))
            low, high = interval(np.log(cost_ratios), resamples=499, seed=trial)
            hits += low <= 0.0 <= high
        assert least <= hits / trials <= 0.985

    def test_without_scipy(self, monkeypatch):
        monkeypatch.setitem(__import__("sys").modules, "scipy.stats", None)
        with pytest.raises(MissingDependencyError, match=r"ikgym\[train\]"):
            interval(np.ones((1, 2)))


class TestProfile:
    def test_by_hand(self):
        cost_ratios = np.array([[1.0, 2.0], [4.0, 1e9]])
        assert profile(cost_ratios, [1.0, 1.9, 2.0, 100.0, 1e9]).tolist() == [0.25, 0.25, 0.5, 0.75, 1.0]


class TestEntries:
    def test_everybody_is_there_once(self):
        names = [entry.spec for entry in solvers(Tuning.load().solvers)]
        assert len(set(names)) == len(names)
        there = {parse_policy(entry.name)[0] for entry in solvers()}
        assert there == {
            name
            for name in registry.names()
            if not (registry.get(name).reference or issubclass(registry.get(name), LearnedPolicy))
        }
        assert {"rhc:horizon=3", "rhc:horizon=3,iterations=1", "rhc:horizon=200,iterations=1,move_blocks=27"} <= set(
            names
        )

    @pytest.mark.parametrize(
        ("name", "expected"),
        [
            ("dls", "dls"),
            ("rhc:horizon=3", "rhc:horizon=3"),
            ("full_orientation", "full_orientation"),
            ("full_orientation:policy=mfac", "full_orientation mfac"),
            (
                "full_orientation:policy=rhc,options={'horizon': 3, 'iterations': 1}",
                "full_orientation rhc:horizon=3,iterations=1",
            ),
        ],
    )
    def test_short_names(self, name, expected):
        assert entries.short(name) == expected

    def test_tuned_is_another_line(self):
        better = solvers([Tuned("dls", {"gain": 0.5}, 2, 2.0, 1.0), Tuned("mfac", {}, 2, 1.0, 1.0)])
        assert [e.spec for e in better if e.name in ("dls", "mfac")] == ["dls", "mfac", "dls, tuned"]
        assert better[-1].variants == (("dls", {"gain": 0.5}),)
        assert better[-1].general

    def test_the_preset_that_draws_has_seeds(self):
        (found,) = [entry for entry in solvers() if entry.name == entries.FORESIGHT]
        assert [parameters["seed"] for _, parameters in found.variants] == list(found.seeds) == [0, 1, 2]

    def test_an_agent_is_a_folder_of_seeds(self, tmp_path):
        write_runs(tmp_path, 3)
        (tmp_path / "seed-2" / "agent.safetensors").touch()
        with pytest.raises(ResultsError, match=r"seed-0.agent\.safetensors is missing"):
            agents([f"mine={tmp_path}"])
        for seed in range(3):
            (tmp_path / f"seed-{seed}" / "agent.safetensors").touch()
        (found,) = agents([f"mine={tmp_path}"])
        assert found.variants[2] == ("agent", {"path": str(tmp_path / "seed-2" / "agent.safetensors")})
        assert found.seeds == (0, 1, 2)
        assert found.training == Training("ppo", None, (100, 101, 102), (0.5, 0.5, 0.5))

    def test_what_is_no_agent(self, tmp_path):
        for text, message in {
            "mine": "NAME=DIR",
            f"dls={tmp_path}": "'dls' is taken",
            f"mine={tmp_path}": "expected folders seed-0",
        }.items():
            with pytest.raises((InvalidInputError, ResultsError), match=message):
                agents([text])
        write_runs(tmp_path, 1, method="ppo")
        (tmp_path / "seed-0" / "agent.safetensors").touch()
        (tmp_path / "seed-0" / "run.json").write_text("{}")
        with pytest.raises(ResultsError, match=r"run\.json"):
            agents([f"mine={tmp_path}"])

    def test_seeds_of_different_trainings(self, tmp_path):
        write_runs(tmp_path, 1, base_policy="dls")
        write_runs(tmp_path, 1, first=1)
        with pytest.raises(ResultsError, match="expected seeds of one training"):
            agents([f"mine={tmp_path}"])


def write_runs(folder, seeds, *, first=0, method="ppo", base_policy=None):
    for seed in range(first, first + seeds):
        run = {
            "method": method,
            "training": {"steps": 100 + seed, "core_minutes": 0.5},
            "processing": {"base_policy": base_policy},
        }
        (folder / f"seed-{seed}").mkdir(parents=True)
        (folder / f"seed-{seed}" / "run.json").write_text(json.dumps(run))


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


class TestPlaces:
    def test_what_is_changed(self):
        base, larger, faster = map(places.get, places.names()[:3])
        assert larger.trajectory.amplitude == pytest.approx(1.2 * base.trajectory.amplitude)
        assert larger.trajectory.frequency == base.trajectory.frequency == (1.0, 3.0)
        assert faster.trajectory.frequency == (1.0, 4.0)
        assert len({fingerprint(places.get(name)) for name in places.names()}) == 4
        assert [places.get(name).name for name in places.names()] == list(places.names())
        assert not {larger.name, faster.name} & set(scenarios.names())

    def test_unknown(self):
        with pytest.raises(UnknownNameError, match="Did you mean 'varga7-fast'"):
            places.get("varga7-fst")

    def test_who_plays_what(self):
        everyone = [fake(dampings=(1e-2, 2e-2)), *solvers()]
        main_set = plan(places.MAIN, everyone, 1)
        assert list(main_set) == [entry.spec for entry in everyone]
        jobs = plan("varga7-random-amplitude", everyone)
        assert set(jobs) == {"fake", *entries.GENERAL}
        assert [len(jobs[name]) for name in ("fake", "dls", entries.FORESIGHT)] == [64, 32, 96]
        assert not any(job.timed or job.first for of in jobs.values() for job in of)
        assert {job.seed for job in jobs["dls"]} == set(scenarios.seeds("test", 32))
        assert [len(of) for of in plan("varga7-fast", everyone[:1]).values()] == [2]

    def test_frozen_set_as_a_whole(self):
        jobs = plan(places.MAIN, [fake()])["fake"]
        assert len(jobs) == 3 * 64
        assert {job.test_set for job in jobs} == {test_sets.SETS[places.MAIN].digest}


FEW = (
    fake(),
    Entry("dls", (("dls", {}),)),
    Entry("dls", (("dls", {"gain": 0.5}),), settings={"gain": 0.5}),
    Entry("rhc_foresight", (("rhc_foresight", {"seed": 0}), ("rhc_foresight", {"seed": 1})), (0, 1), timed=1),
)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("leaderboard")


@pytest.fixture(scope="module")
def played(out):
    return measure(places.MAIN, FEW[:3], out, episodes=2)


class TestMeasure:
    def test_lines_are_what_an_evaluation_gives(self, played):
        assert [one.label for one in played.lines] == ["fake", "dls", "dls, tuned"]
        rows = evaluate(
            places.MAIN, [*(f"dls:damping={d}" for d in (1e-2, 2e-2, 3e-2)), "dls", "dls:gain=0.5"], episodes=2
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

    def test_what_is_done_is_not_done_again(self, played, out, monkeypatch):
        monkeypatch.setattr("baselines.evaluation.runner.play", lambda *_: pytest.fail("played again"))
        assert measure(places.MAIN, FEW[:3], out, episodes=2, resume=True) == played
        with pytest.raises(ResultsError, match="--resume"):
            measure(places.MAIN, FEW[:3], out, episodes=2)

    def test_changed_scenarios_are_relative_to_foresight(self, out):
        found = measure("varga7-random-frequency", FEW[1:], out, episodes=1)
        assert found.best_known is None
        cost_ratios = found.cost_ratios()
        assert cost_ratios["rhc_foresight"].min() == 1.0 < cost_ratios["rhc_foresight"].max()
        assert cost_ratios["dls"][0, 0] == found.lines[0].cost[0][0] / min(cost for (cost,) in found.lines[2].cost)
        assert found.lines[0].time_p50_us is None
        (row,) = evaluate(places.get("varga7-random-frequency"), "dls")
        assert found.lines[0].cost[0][0] == pytest.approx(row.total_cost, rel=1e-6)

    def test_agents_from_their_files(self, tmp_path):
        write_runs(tmp_path / "mine", 2, base_policy="dls")
        write_runs(tmp_path / "other", 1, base_policy="dls")
        for seed in range(2):
            write_agent(tmp_path / "mine" / f"seed-{seed}", "varga7-random", seed)
        write_agent(tmp_path / "other" / "seed-0", "zhang6-lspb", 0)
        (mine,) = agents([f"mine={tmp_path / 'mine'}"])
        (found,) = measure("varga7-fast", [mine], tmp_path / "out").lines
        assert (found.kind, found.preview, found.seeds, np.shape(found.cost)) == (RESIDUAL, 240, (0, 1), (2, 1))
        assert found.cost[0] != found.cost[1]
        write_agent(tmp_path / "mine" / "seed-1", "varga7-random", 5)
        (again,) = measure("varga7-fast", [mine], tmp_path / "out", resume=True).lines
        assert again.cost[0] == found.cost[0]
        assert again.cost[1] != found.cost[1], "another agent in the same file is played again"
        with pytest.raises(InvalidInputError, match="other: made for another task or arm than that of varga7-random"):
            plan(places.MAIN, [mine, *agents([f"other={tmp_path / 'other'}"])], 1)

    def test_foresight_has_to_be_there(self):
        section = a_section(line(), name="varga7-random-amplitude")
        with pytest.raises(InvalidInputError, match="rhc_foresight was not played"):
            section.cost_ratios()


class TestBoard:
    def test_kinds(self):
        assert line().kind == line(preview=2).kind == NEAR
        assert line(preview=3).kind == FAR
        assert learned("x", ((1.0, 1.0),)).kind == AGENT
        assert learned("x", ((1.0, 1.0),), base_policy="dls").kind == RESIDUAL

    def test_shares(self):
        one = dataclasses.replace(line(), error=((0.0010, 0.0011), (0.0101, 0.051)), cost=((1.0, 1.0), (1.0, 1.0)))
        assert (one.within(0.010), one.within(0.001), one.lost, one.runs) == (0.5, 0.25, 1, 4)

    def test_seeds_enough(self):
        assert line().benchmark
        assert learned("x", ((1.0, 1.0),) * 5).benchmark
        assert not learned("x", ((1.0, 1.0),) * 4).benchmark

    def test_a_file_is_read_as_it_was_written(self, tmp_path):
        there = a_board(a_section(line(), learned("x", ((1.0, 2.5), (3.0, 1e9)))), a_section(name="varga7-fast"))
        there.save(tmp_path / "it.json")
        assert Board.load(tmp_path / "it.json") == there

    @pytest.mark.parametrize("text", ["", "[]", '{"sections": []}', '{"sections": [{"name": "x"}]}'])
    def test_damaged(self, tmp_path, text):
        (tmp_path / "it.json").write_text(text)
        with pytest.raises(ResultsError, match=r"it\.json"):
            Board.load(tmp_path / "it.json")

    def test_stale(self):
        assert dataclasses.replace(a_section(), fingerprint="0" * 12).stale


class TestClaims:
    def test_an_agent_below_all(self):
        section = a_section(
            line("dls", ((4.0, 4.0),)),
            line("mfac", ((9.0, 4.0),)),
            line("rhc:horizon=100", ((1.0, 1.0),), preview=99),
            learned("residual", ((2.0, 2.0),) * 5, base_policy="dls"),
            learned("PPO", ((3.0, 3.0),) * 5),
            learned("lucky", ((1.5, 1.5),)),
        )
        text = "\n".join(sentences(section))
        assert "The best agent is residual (2.000); it loses track in 0 of 10 runs." in text
        assert "It adds to `dls` and sees 240 steps ahead" in text
        assert "The best without a solver under it is PPO (3.000)." in text
        assert "below all 2 solvers" in text
        assert "its cost is 0.5000 (0.5000 to 0.5000) times that of the best of them, `dls` (4.000)." in text
        assert (
            "Its cost is 2.000 (2.000 to 2.000) times that of `rhc:horizon=100` (1.000), which looks further." in text
        )
        assert "lucky" not in text

    def test_an_agent_that_is_not(self):
        section = a_section(
            line("dls", ((4.0, 4.0),)),
            line("dls", ((2.0, 2.0),), settings={"gain": 0.5}),
            learned("PPO", ((3.0, 3.0),), error=0.06),
        )
        text = "\n".join(sentences(section))
        assert "PPO (3.000) (1 seed: not a benchmark); it loses track in 2 of 2 runs." in text
        assert "**not** below" in text
        assert "1 of 2 are as low or lower, namely `dls`, tuned (2.000)" in text
        assert "1.500 (1.500 to 1.500)" in text

    def test_no_agent(self):
        text = "\n".join(sentences(a_section(line("dls"), line("mfac", ((1.0, 1.0),)))))
        assert "No agent has been entered" in text
        assert "paper's horizon is `mfac` (1.000)" in text

    def test_a_comparison_is_by_episodes(self):
        """Episodes that are hard for both say nothing of their ratio."""
        hard = np.exp(np.random.default_rng(1).normal(size=(1, 30)))
        found = Comparison.of(np.tile(2.0 * hard, (3, 1)), np.vstack([0.5 * hard, 2.0 * hard]))
        assert (found.ratio, found.low, found.high) == pytest.approx((2.0, 2.0, 2.0))


class TestPage:
    @pytest.fixture
    def board(self):
        fast = [row.total_cost for row in evaluate("varga7-fast", "dls", steps=3000)]
        place = a_section(
            dataclasses.replace(line(), cost=((fast[0],),), error=((0.1,),)), seeds=(0,), name="varga7-fast"
        )
        return a_board(
            a_section(
                line("dls", ((2.0, 8.0),), error=0.009),
                line("dls", ((2.0, 2.0),), settings={"gain": 0.5}),
                line("rhc_foresight", ((1.0, 1.0), (1.0, 1.21)), preview=1500, seeds=(0, 1)),
                learned("PPO", ((3.0, 12.0),) * 5, error=0.06),
                learned("few", ((1.1, 1.1),) * 2, base_policy="dls"),
            ),
            place,
        )

    def test_what_it_says(self, board, tuning):
        lines = page(board, tuning).splitlines()
        rows = [cells for text in lines if len(cells := [cell.strip() for cell in text.strip("|").split("|")]) == 15]
        table = {cells[0].strip("*"): cells for cells in rows}
        assert [*table][2:] == ["`oracle`", "`rhc_foresight`", "few", "`dls`, tuned", "`dls`", "PPO"]
        kind, cost_ratio, _, median, p90, worst, ten, one, lost, p50, p99, seeds, steps, cost = table["`dls`"][1:]
        assert (kind, cost_ratio, median, p90, worst) == ("solver", "4.000", "5.000", "7.400", "8.000")
        assert (ten, one, lost, p50, p99, seeds) == ("100 %", "0 %", "0 %", "10", "20", "deterministic")
        assert (steps, cost) == ("–", "–")
        assert table["PPO"][:3] == ["**PPO**", "agent", "**6.000**"]
        assert table["PPO"][10 - 1 :] == ["100 %", "10", "20", "5", "1.000e6", "12.00"]
        assert table["few"][12] == "2 seeds: not a benchmark"
        assert table["few"][0] == "**few**"
        assert table["`rhc_foresight`"][12] == "2 of the policy"
        assert table["`dls`, tuned"][:3] == ["**`dls`, tuned**", "solver, tuned", "**2.000**"]
        assert table["`dls`"][0] == "`dls`"
        low, high = map(float, table["`dls`"][3].split(" … "))
        assert (low, high) == (2.0, 8.0)

    def test_generalisation_and_tuning(self, board, tuning):
        text = page(board, tuning)
        assert "- `varga7-fast`: the fast trajectory of Varga 2021, 3,000 steps; 1 episode; cost ratios." in text
        (row,) = evaluate("varga7-fast", "dls")
        (found,) = [
            text for text in text.splitlines() if text.startswith("| `dls` | solver | ") and "100 %" in text[-9:]
        ]
        assert float(found.split("|")[3]) == pytest.approx(row.cost_ratio, rel=1e-3)
        assert "| `dls` | `gain=0.5` | 7 | 4.000 | 2.000 | 0.5000 |" in text
        assert "the first 4 validation episodes" in text

    def test_pictures(self, board, tuning):
        text, drawn = page(board, tuning), dict(pictures(board))
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

    def test_no_names_overlap(self, board):
        many = [line(f"solver_{k}", ((1.0 + k, 9.0**k),)) for k in range(40)]
        (_, means), (_, profiles) = pictures(a_board(a_section(*many)))
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


GRID = {"dls": (product(gain=(0.5, 1.0), damping=(1e-2,)), product(gain=(0.7,)))}


@pytest.fixture(scope="module")
def found():
    return tune("a command", "2000-01-01", grids=GRID, episodes=2)


class TestTuning:
    def test_it_is_the_lowest_cost_of_what_was_tried(self, found):
        (one,) = found.solvers
        tried = [{}, {"gain": 0.5, "damping": 1e-2}, {"gain": 1.0, "damping": 1e-2}, {"gain": 0.7, "damping": 1e-2}]
        rows = evaluate(places.MAIN, [("dls", settings) for settings in tried], episodes=2, split="validation")
        costs = np.exp(np.log([row.total_cost for row in rows]).reshape(4, 2).mean(axis=1))
        assert one.settings == tried[int(costs.argmin())]
        assert (one.tried, one.default, one.tuned) == (4, pytest.approx(costs[0]), pytest.approx(costs.min()))

    def test_a_stage_starts_from_the_best_of_the_one_before(self, monkeypatch):
        def bowl(trials, *_):
            wanted = {"damping": 1e-2, "gain": 0.7}
            return [1.0 + sum(trial.settings.get(n, 9.0) != value for n, value in wanted.items()) for trial in trials]

        monkeypatch.setattr("baselines.evaluation.leaderboard.tuning._costs", bowl)
        stages = (product(damping=(1e-3, 1e-2, 1e-1)), (), product(gain=(0.5, 0.7)))
        (one,) = tune("a", "b", grids={"dls": stages}).solvers
        assert one == Tuned("dls", {"damping": 1e-2, "gain": 0.7}, 6, 3.0, 1.0)

    def test_no_test_episode_is_played(self, monkeypatch):
        seen = []

        def spy(jobs, **_):
            seen.extend(job.seed for job in jobs)
            raise KeyboardInterrupt

        monkeypatch.setattr("baselines.evaluation.leaderboard.tuning.run", spy)
        with pytest.raises(KeyboardInterrupt):
            tune("a command", "2000-01-01", grids=GRID, episodes=EPISODES)
        assert len(set(seen)) == EPISODES
        assert set(seen) <= set(scenarios.SPLITS["validation"])
        assert not set(seen) & set(scenarios.SPLITS["test"])

    def test_nothing_better_is_no_setting(self):
        found = tune("a", "b", grids={"dls": (product(damping=(1e3,)),)}, episodes=1)
        assert found.solvers[0].settings == {}
        assert found.solvers[0].tuned == found.solvers[0].default

    def test_a_file_is_read_as_it_was_written(self, found, tmp_path):
        found.save(tmp_path / "it.json")
        assert Tuning.load(tmp_path / "it.json") == found

    def test_what_is_refused(self, found, tmp_path):
        file = tmp_path / "it.json"
        for text in ("", "[]", '{"solvers": []}'):
            file.write_text(text)
            with pytest.raises(ResultsError, match=r"it\.json"):
                Tuning.load(file)
        dataclasses.replace(found, fingerprint="0" * 12).save(file)
        with pytest.raises(ResultsError, match="changed since"):
            Tuning.load(file)
        with pytest.raises(InvalidInputError, match="split 'test'"):
            dataclasses.replace(found, split="test")

    def test_grids_look_no_further(self):
        assert decades(-2, 0) == (0.01, 0.032, 0.1, 0.32, 1.0)
        scenario = scenarios.get(places.MAIN)
        for spec, stages in GRIDS.items():
            name, parameters = parse_policy(spec)
            ahead = registry.make(name, scenario, **parameters).preview
            assert ahead <= entries.PAPER
            for settings in stages[0]:
                assert registry.make(name, scenario, **{**parameters, **settings}).preview == ahead

    def test_the_file_in_the_tree(self):
        there = Tuning.load(DATA)
        assert (there.scenario, there.split, there.episodes) == (places.MAIN, "validation", EPISODES)
        assert set(there.seeds) <= set(scenarios.SPLITS["validation"])
        assert not set(there.seeds) & set(TEST_SEEDS)
        assert {one.spec for one in there.solvers} == set(GRIDS), f"stale: {UPDATE}"
        assert all(one.tuned <= one.default for one in there.solvers)

    def test_a_part_of_it_tuned_again(self):
        there = Tuning.load(DATA)
        (then,) = [one for one in there.solvers if one.spec == "dls"]
        rows = evaluate(places.MAIN, [then.variant], episodes=there.episodes, split="validation")
        assert np.exp(np.log([row.total_cost for row in rows]).mean()) == pytest.approx(then.tuned, rel=1e-4)


class TestCommandLine:
    def test_plays_writes_and_draws_up_again(self, tmp_path, capsys, monkeypatch):
        monkeypatch.setattr(command, "solvers", lambda *_: (*FEW[1:3], dataclasses.replace(FEW[3])))
        monkeypatch.setattr(entries, "policy_of", lambda folder: ("dls", {"damping": 10.0 ** -int(folder.name[5:])}))
        write_runs(tmp_path / "ppo", 5, base_policy="dls")
        file = tmp_path / "page" / "leaderboard.md"
        arguments = ["--agents", f"PPO from scratch={tmp_path / 'ppo'}", "--episodes", "1"]
        arguments += ["--out", str(tmp_path / "out"), "--write", str(file)]
        assert main(arguments) == 0
        assert str(file) in capsys.readouterr().out
        text = file.read_text(encoding="utf-8")
        assert "The best agent is PPO from scratch" in text
        assert "| residual agent |" in text
        assert "relative to `rhc_foresight`." in text
        for name in ("means", "profiles"):
            picture = PIL.Image.open(io.BytesIO((file.parent / "images" / f"leaderboard-{name}.png").read_bytes()))
            assert picture.size[0] > 1000
        board = Board.load(file.with_suffix(".json"))
        assert [one.name for one in board.sections] == list(places.names())
        assert len(board.sections[0].lines[0].cost) == 5
        file.unlink()
        assert main(["--write", str(file)]) == 0
        assert file.read_text(encoding="utf-8") == text
        capsys.readouterr()
        assert main(arguments) == 2
        assert "--resume" in capsys.readouterr().err

    def test_tunes(self, tmp_path, capsys, monkeypatch):
        grids = {"dls": (product(gain=(0.5,)),)}
        monkeypatch.setattr(command, "tune", lambda *a, **k: tune(*a, **{**k, "grids": grids}))
        file = tmp_path / "tuned.json"
        assert main(["--tune", str(file), "--episodes", "1"]) == 0
        printed = capsys.readouterr().out
        assert printed.startswith("| solver | as it is | tuned | ratio | settings |")
        found = Tuning.load(file)
        assert (found.solvers[0].spec, found.episodes) == ("dls", 1)
        assert found.command.endswith("--episodes 1")

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ([], "--out"),
            (["--write", "nowhere.md"], r"nowhere\.json"),
            (["--write", "nowhere.md", "--agents", "a=b"], "expected --out"),
            (["--out", "out", "--agents", "a"], "NAME=DIR"),
            (["--out", "out", "--agents", "a=nowhere"], "expected folders seed-0"),
        ],
    )
    def test_what_cannot_be_is_one_line_and_2(self, arguments, message, capsys, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        assert main(arguments) == 2
        err = capsys.readouterr().err
        assert err.startswith("error: ")
        assert err.count("\n") == 1
        assert re.search(message, err)


@pytest.mark.skipif(not (DOCS / "leaderboard.json").exists(), reason="no leaderboard has been measured yet")
class TestTree:
    """What lies in docs/: the page follows from the numbers beside it, and they are those of today's code."""

    @pytest.fixture
    def written(self):
        return Board.load(DOCS / "leaderboard.json")

    def test_the_page_says_what_was_measured(self, written):
        there = (DOCS / "leaderboard.md").read_text(encoding="utf-8")
        assert page(written, Tuning.load()) == there, f"docs/leaderboard.md is stale: {REMEDY}"

    def test_it_has_all_solvers_and_places(self, written):
        assert [one.name for one in written.sections] == list(places.names())
        main_set = written.sections[0]
        assert (main_set.test_set, main_set.seeds) == (test_sets.SETS[places.MAIN].digest, TEST_SEEDS)
        assert not [one.name for one in written.sections if one.stale]
        found = {one.label: one.settings for one in main_set.lines if not one.learned}
        expected = {e.spec: json.loads(json.dumps(e.settings)) for e in solvers(Tuning.load().solvers)}
        assert found == expected

    def test_agents_have_seeds_enough(self, written):
        assert all(one.benchmark for one in written.sections[0].lines)

    def test_it_names_no_folder_of_a_machine(self, written):
        assert not re.search(r"(^|[\s=])/", written.command)

    def test_a_part_measured_again(self, written):
        (then,) = [one for one in written.sections[0].lines if one.label == "dls, tuned"]
        rows = evaluate(places.MAIN, ("dls", then.settings), episodes=2)
        assert [row.total_cost for row in rows] == pytest.approx(then.cost[0][:2], rel=1e-4)


def test_confidence_is_what_the_page_says():
    assert (statistics.CONFIDENCE, statistics.RESAMPLES) == (0.95, 9999)
