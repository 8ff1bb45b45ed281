import dataclasses
import json
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

import baselines
import ikgym
from baselines.cli.commands import oracle as optimum_command
from baselines.episodes import rollout
from baselines.fingerprints import episode_hash
from baselines.oracle import Search, Start, best_known, cache, local_search, solve
from baselines.oracle.episode import EpisodeProblem
from baselines.oracle.optimum import LOCAL_SEARCH, RANDOM
from baselines.oracle.stripped import strip_plant
from baselines.policy import Problem
from baselines.solvers.receding_horizon.newton.minimise import NewtonSettings
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.kernels import threads
from ikgym.plant import Plant
from ikgym.trajectories import RandomJointSpline
from tests.comparison import identical
from tests.independent.casadi_horizon import CasadiHorizon
from tests.independent.numpy_horizon import Horizon, plan_cost

QUICK = Search(starts=12, chains=2, generations=1, rounds=4, polished=2, knots=20)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache" / "oracle"


def short(like="varga7-fast", steps=30, **changes):
    return ikgym.scenarios.get(like).replace(steps=steps, **changes)


CASES = {
    "fixed": (short(), 0),
    "random": (short("varga7-random"), 1_000_003),
    "off the path": (short(start=np.full(7, 0.01)), 0),
    "held": (short("khan8-q7q8", 130), 0),
    "held at times": (short(iterations_per_point=(3, 1, 1, 2, 1)), 0),
    "ends while a point is held": (short(steps=8, iterations_per_point=3), 0),
    "another measured start": (short("zhang3-helix"), 0),
    "position": (short("faitli3-regular"), 0),
    "pose": (short("zhang6-lspb"), 0),
    "axis": (short("zhang6-lspb", task=ikgym.tasks.get("axis")), 0),
    "narrow limits": (short(velocity_limit=np.full(7, 5.0)), 0),
    "one step": (short(steps=1), 0),
}


def rolled(scenario, seed, name="oracle", **parameters):
    given = {"seed": seed} if scenario.random and baselines.registry.get(name).reference else {}
    episode = rollout(scenario, baselines.make(name, scenario, **given, **parameters), seed)
    return episode, float(np.sum(episode.tracking_cost + episode.velocity_cost))


@pytest.mark.parametrize(("scenario", "seed"), CASES.values(), ids=CASES)
def test_an_optimum_is_what_the_environment_charges_and_nothing_tried_is_cheaper(scenario, seed):
    optimum = solve(scenario, seed, QUICK)
    assert optimum.q.shape == optimum.qdot.shape == (scenario.steps, scenario.joints)
    assert (np.abs(optimum.qdot) <= scenario.velocity_limit).all()
    # Written down anew: the arm goes where it is sent, and the steps that count cost.
    trajectory = scenario.trajectory.sample(np.random.default_rng(0)) if not scenario.random else None
    start = scenario.first_q(trajectory) if trajectory else scenario.nominal_joint_path(seed)[0]
    q = start + scenario.dt * np.cumsum(optimum.qdot, axis=0)
    assert_allclose(optimum.q, q, rtol=0, atol=1e-12)
    pose = scenario.task.coordinates(*scenario.arm.forward(optimum.q))
    stage = scenario.cost.tracking(scenario.task.error(scenario.nominal(seed)[1:], pose))
    stage += scenario.cost.velocity(optimum.qdot)
    assert optimum.cost == pytest.approx(float(np.sum(stage[scenario.counted()[1:]])), rel=1e-12, abs=1e-20)
    assert optimum.gradient_norm <= 1e-7 * max(optimum.cost, 1.0)
    assert optimum.cost == min(one.cost for one in optimum.starts if one.cost is not None)
    names = ["dls"] if scenario.nominal_joint_path(seed) is None else ["dls", "follow_nominal"]
    for name in names:
        assert optimum.cost <= rolled(scenario, seed, name)[1] * (1.0 + 1e-9) + 1e-9


@pytest.mark.parametrize("name", ["random", "held", "another measured start", "narrow limits"])
def test_the_policy_plays_the_optimum(name):
    scenario, seed = CASES[name]
    optimum = solve(scenario, seed, Search(starts=0, generations=0))
    episode, cost = rolled(scenario, seed, starts=0, generations=0)
    # What float32 actions leave.
    assert cost == pytest.approx(optimum.cost, rel=1e-5, abs=1e-9)
    assert_allclose(episode.q, optimum.q, rtol=0, atol=1e-5 * scenario.dt / 1e-3)


def test_the_same_whatever_the_number_of_threads(monkeypatch):
    scenario, results = short("varga7-random", 65), []
    for cores in (1, 5):
        monkeypatch.setattr(threads, "count_cores", lambda cores=cores: cores)
        optimum = solve(scenario, 3, QUICK, cached=False)
        results.append((optimum.q, optimum.qdot, optimum.cost, *(dataclasses.astuple(one) for one in optimum.starts)))
    assert identical(results[0][:3], results[1][:3])
    assert results[0][3:] == results[1][3:]
    other = solve(scenario, 3, QUICK.replace(seed=1), cached=False)
    assert [one.coarse for one in other.starts] != [one.coarse for one in optimum.starts]


def test_kinds_of_starts():
    optimum = solve(short("varga7-random", 60), 7, QUICK)
    kinds = [one.kind for one in optimum.starts]
    known = ["nominal joint path", "roll-out", "rhc, horizon 1001", "rhc, horizon 101"]
    assert kinds[: 4 + QUICK.starts] == known + [RANDOM] * QUICK.starts
    assert set(kinds[4 + QUICK.starts :]) <= {LOCAL_SEARCH}
    assert all(one.cost is not None for one in optimum.starts[:4])
    assert set(optimum.found_by.split("; ")) <= {*known, RANDOM, LOCAL_SEARCH}
    json.dumps(dataclasses.asdict(optimum.record()))
    assert [one.kind for one in solve("zhang3-helix", 0, Search(starts=0, generations=0)).starts] == known[1:]


def test_what_is_said_of_the_starts():
    starts = (
        Start("nominal joint path", 100.0, 10.0 * (1.0 + 1e-7)),
        Start(RANDOM, 10.2, 10.0),
        Start(RANDOM, 10.06, 10.0 * (1.0 + 1e-5)),
        Start(RANDOM, 900.0),
        Start(RANDOM, math.inf),  # leaves the limits
        Start(LOCAL_SEARCH, 10.05, 10.0),
    )
    optimum = solve(short(steps=2), 0, QUICK).replace(cost=10.0, starts=starts)
    assert optimum.found_by == "nominal joint path; random start; local search"
    assert optimum.spread == {
        "starts": 5,
        "within_1_percent": 1,
        "median": (100.0 + 10.2) / 2.0,
        "worst": 900.0,
        "polished": 4,
        "polished_within_1e-6": 3,
        "without_search": 10.0 * (1.0 + 1e-7),
    }
    assert optimum.record().spread == optimum.spread
    # Where nothing costs, all that is left is rounding.
    free = optimum.replace(cost=1e-16, starts=(Start("nominal joint path", cost=1e-16), Start("roll-out", cost=1e-12)))
    assert free.found_by == "nominal joint path; roll-out"
    assert free.spread == {"polished": 2, "polished_within_1e-6": 2, "without_search": 1e-16}


def test_the_local_search_finds_what_a_start_does_not():
    """Of two paths the first is a hundred times too costly."""
    whole = EpisodeProblem.of(ikgym.scenarios.get("varga7-random"), 1_000_011)
    problem = whole.on(whole.coarse(25))
    before = np.empty((2, len(problem.grid.at), 7))
    local_search.random_paths(problem, 0, before, 0, 2)
    improved = local_search.Improved(*np.empty((2, 2)))
    local_search.improve(problem, NewtonSettings(False, 50, 1e-4), before, improved, 0, 2)
    paths, costs = before.copy(), improved.costs.copy()
    local_search.iterated_local_search(problem, 0, 40, before, paths, costs, 0, 1)
    assert costs[0] < 0.1 * improved.costs[0]
    assert costs[1] == improved.costs[1]
    assert identical(paths[1], before[1])


class TestGrid:
    @pytest.mark.parametrize("steps", [1, 37])
    @pytest.mark.parametrize("stride", [1, 5])
    def test_a_coarse_grid_counts_all_steps(self, steps, stride):
        for held in (1, (2, 1, 1, 3, 1)):
            whole = EpisodeProblem.of(short(steps=steps, iterations_per_point=held), 0)
            grid = whole.coarse(stride)
            assert grid.at[-1] == steps
            assert (np.diff(grid.at) > 0).all()
            for part, total in zip(grid[1:], whole.grid[1:], strict=True):
                assert part.sum() == pytest.approx(total.sum())
            if stride == 1:
                assert all(identical(a, b) for a, b in zip(grid, whole.grid, strict=True))

    def test_held_points_are_free_of_charge(self):
        scenario = short("khan8-q7q8", 130)
        whole = EpisodeProblem.of(scenario, 0)
        assert whole.grid.at.tolist() == [60, 120, 130]
        assert whole.grid.length.tolist() == [59, 59, 9]
        assert not whole.grid.velocity.any()
        optimum = solve(scenario, 0, QUICK)
        assert optimum.cost <= best_known.MEANINGLESS
        assert optimum.found_by == "nominal joint path; roll-out"
        assert not optimum.qdot[scenario.counted()[1:]].any()
        assert optimum.qdot.any()


def kept(folder):
    return sorted(folder.glob("*")) if folder.exists() else []


def test_limits_are_kept_and_cost_what_they_must():
    free = short(steps=40)
    path = free.nominal_joint_path()
    bounds = {"upper": np.maximum(0.5 * path.max(axis=0), 1e-2), "lower": -np.ones(7)}
    bounds["velocity_limit"] = np.append(np.full(6, np.inf), 0.9 * np.abs(np.diff(path, axis=0)[:, 6]).max() / free.dt)
    for names in (["lower", "upper"], ["velocity_limit"]):
        scenario = free.replace(arm=free.arm.replace(**{name: bounds[name] for name in names}))
        optimum = solve(scenario, 0, QUICK)
        assert (optimum.q <= scenario.arm.upper).all()
        assert (np.abs(optimum.qdot) <= scenario.largest_qdot).all()
        if "upper" in names:
            assert (scenario.arm.upper - optimum.q).min() < 1e-9  # a limit in the way
        policy = baselines.make("oracle", scenario, starts=0, generations=0)
        assert not rollout(scenario, policy, 0).at_limit.any()
        assert optimum.cost >= solve(free, 0, QUICK).cost
        assert optimum.cost <= rolled(scenario, 0, "rhc")[1] * (1.0 + 1e-9), names


def panda_spline(steps=100, **changes):
    """A lively motion of a Panda from rest to rest."""
    arm = ikgym.arms.get("panda")
    motion = RandomJointSpline.within(arm, steps * 2e-3, margin=0.0, scale=(0.8, 1.0)).sample(np.random.default_rng(3))
    fields = {"arm": arm, "task": ikgym.tasks.get("pose"), "trajectory": motion, "dt": 2e-3, "steps": steps}
    return ikgym.Scenario("spline", **(fields | changes))


@pytest.mark.slow
def test_limits_of_acceleration_are_kept():
    """No cheaper path is known to IPOPT, and the plant holds nothing back."""
    scenario = panda_spline()
    optimum = solve(scenario, 0, QUICK)
    policy = baselines.make("oracle", scenario, starts=0, generations=0)
    assert not rollout(scenario, policy, 0).at_limit.any()
    changes = np.diff(optimum.qdot, axis=0, prepend=0.0) / scenario.dt
    assert (abs(changes) <= (1.0 + 1e-6) * scenario.arm.acceleration_limit).all()
    assert (abs(changes) >= (1.0 - 1e-4) * scenario.arm.acceleration_limit).any()  # a limit in the way
    for name in ("dls", "rhc", "follow_nominal"):
        assert optimum.cost <= rolled(scenario, 0, name)[1] * (1.0 + 1e-9), name
    problem, nominal = Problem.of(scenario), scenario.nominal(0)[1:]
    horizon = Horizon(scenario.first_q(scenario.trajectory), nominal[: scenario.steps])
    best = CasadiHorizon(problem, scenario.steps, limited=True).solve(horizon, optimum.q)
    assert best.converged
    assert optimum.cost <= best.cost * (1.0 + 1e-6)


class TestCache:
    def test_a_hit_is_what_was_found(self, folder, monkeypatch):
        fresh = solve(short(), 0, QUICK, cached=False)
        assert not kept(folder)
        first = solve(short(), 0, QUICK)
        assert len(kept(folder)) == 1
        monkeypatch.setattr(cache, "search", None)
        hit = solve(short(name="other"), 0, QUICK)
        assert hit.scenario == "other"
        with pytest.raises(TypeError):  # searches anew
            solve(short(), 0, QUICK, cached=False)
        assert (hit.starts, hit.seconds, hit.hash) == (first.starts, first.seconds, first.hash)
        assert identical((hit.q, hit.qdot, hit.cost), (fresh.q, fresh.qdot, fresh.cost))
        assert (hit.starts, hit.gradient_norm, hit.hash) == (fresh.starts, fresh.gradient_norm, fresh.hash)
        assert not hit.q.flags.writeable

    def test_another_content_is_another_file(self, monkeypatch):
        files = [
            cache.file_of(short(), 0, QUICK),
            cache.file_of(short(), 1, QUICK),
            cache.file_of(short(steps=31), 0, QUICK),
            cache.file_of(short(), 0, QUICK.replace(starts=13)),
        ]
        monkeypatch.setattr(cache, "VERSION", -1)
        files.append(cache.file_of(short(), 0, QUICK))
        assert len(set(files)) == len(files)

    def test_a_damaged_file_is_made_anew(self, folder, caplog):
        before = solve(short(), 0, QUICK)
        (file,) = kept(folder)
        file.write_bytes(file.read_bytes()[:1000])
        assert identical(solve(short(), 0, QUICK).q, before.q)
        assert "It is replaced." in caplog.text
        caplog.clear()
        solve(short(), 0, QUICK)
        assert not caplog.text
        file.unlink()
        file.mkdir()
        assert identical(solve(short(), 0, QUICK).q, before.q)
        assert "The optimum is not kept" in caplog.text


@pytest.mark.parametrize(
    ("call", "error", "match"),
    [
        (lambda: solve("varga7-fsat"), UnknownNameError, "Did you mean 'varga7-fast'"),
        (lambda: solve("varga7-random", -1), InvalidInputError, "seed: expected a whole number of at least 0"),
        (lambda: Search(polished=0), InvalidInputError, "polished: expected a whole number of at least 1"),
        (lambda: Search(knots=2.5), InvalidInputError, "knots: expected a whole number"),
        (lambda: solve(short(), arm_seed=1), InvalidInputError, "arm"),
        (
            lambda: solve(panda_spline(iterations_per_point=3)),
            InvalidInputError,
            "expected iterations_per_point=1 with",
        ),
        (lambda: baselines.make("oracle", "varga7-random"), InvalidInputError, "a seed says which episode"),
        (lambda: baselines.make("oracle", "varga7-random", seed="x"), InvalidInputError, "seed: expected a whole"),
        (lambda: baselines.make("oracle", "varga7-fast", starts=-1), InvalidInputError, "starts: expected a whole"),
        (lambda: baselines.make("oracle", short(plant=Plant(noise=0.1))), InvalidInputError, "without drives and sens"),
    ],
)
def test_bad_input(call, error, match):
    with pytest.raises(error, match=match):
        call()


def test_drives_and_sensors_are_stripped():
    late = Plant(noise=0.1, bias=0.2, bandwidth=20.0, command_delay=3, q_noise=1e-3, pose_every=5)
    assert solve(short(plant=late), how=QUICK).cost == solve(short(), how=QUICK).cost


def test_the_arm_that_moves_is_polished(monkeypatch):
    """From the poses of the path that the search has found for the ideal plant."""
    calibrated, polish, began = short("panda-ideal", plant=Plant(zero=1e-3)), cache.polish, []
    monkeypatch.setattr(cache, "polish", lambda *given: began.append(given[2][cache.IDEAL]) or polish(*given))
    (first, again), other = (solve(calibrated, 5, QUICK) for _ in range(2)), solve(calibrated, 5, QUICK, arm_seed=2)
    assert first.found_by == cache.IDEAL
    assert first.cost == again.cost != other.cost
    _, played = EpisodeProblem.of(strip_plant(calibrated, 5), 5).play(first.qdot)
    assert played == first.cost
    searched = calibrated.arm.forward(solve(short("panda-ideal"), 5, QUICK).q)
    for there, wanted in zip(strip_plant(calibrated, 5).arm.forward(began[-1]), searched, strict=True):
        assert_allclose(there, wanted, rtol=0, atol=1e-8)


class TestCommandLine:
    RANDOM = ("--scenarios", "short", "--starts", "2", "--generations", "0", "--knots", "30", "--seeds", "1000000")

    @pytest.fixture(autouse=True)
    def scenario(self, own_registries):
        scenario = short("varga7-random", 100, name="short")
        ikgym.scenarios.register(scenario)
        return scenario

    def test_update(self, file, capsys, scenario):
        assert optimum_command.main([*self.RANDOM, "--update"]) == 0
        (known,) = best_known.read(file)
        out = capsys.readouterr().out
        assert f"short, seed 1000000: {known.cost:.10g}" in out
        assert "1 of 1 records are new or better" in out
        assert known.hash == episode_hash(scenario, 1_000_000)
        assert optimum_command.main([*self.RANDOM, "--update"]) == 0
        assert "0 of 1 records are new or better" in capsys.readouterr().out
        file.unlink()
        best_known._read.cache_clear()
        best_known.record([dataclasses.replace(known, cost=(1.0 + 3e-6) * known.cost)], file)
        assert optimum_command.main([*self.RANDOM, "--update"]) == 0
        assert "1 of 1 records are new or better" in capsys.readouterr().out

    def test_ctrl_c_keeps_what_is_done(self, file, monkeypatch, capsys):
        solved = cache.search

        def interrupted(scenario, seed, *rest):
            if seed == 1_000_001:
                raise KeyboardInterrupt
            return solved(scenario, seed, *rest)

        monkeypatch.setattr(cache, "search", interrupted)
        assert optimum_command.main([*self.RANDOM, "1000001", "1000002", "--update"]) == 130
        assert "are kept" in capsys.readouterr().err
        assert [known.seed for known in best_known.read(file)] == [1_000_000]

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (("--scenarios", "varga7-random"), "expected some for the random scenarios"),
            (("--scenarios", "varga7-fast", "--seeds", "3"), "no random scenario is named"),
            (("--test-sets", "nothing"), "There is no test set 'nothing'"),
        ],
    )
    def test_bad_arguments(self, capsys, arguments, words):
        assert optimum_command.main(arguments) == 2
        assert words in capsys.readouterr().err


# What was recorded.


def test_all_episodes_have_a_record():
    todo = optimum_command.episodes((), (), ())
    every = [ikgym.scenarios.get(name) for name in ikgym.scenarios.names()]
    fixed = {(one.name, 0) for one in every if not (one.random or one.collides)}
    assert fixed < {(scenario.name, draw.seed) for scenario, draw in todo}
    known = {(one.scenario, one.seed) for one in best_known.read()}  # of which test_best_known looks some up
    others = [(one, draw) for one, draw in todo if (one.name, draw.seed) not in known]
    missing = [(one.name, draw.seed) for one, draw in others if not best_known.lookup(one, draw.seed, draw.arm_seed)]
    assert not missing, f"find them with: {best_known.UPDATE}"


#: Without random starts and local search: to these records the nominal joint path leads, too.
FROM_THE_PATH = Search(starts=0, generations=0)


@pytest.mark.parametrize(
    ("name", "seed", "how"),
    [
        ("tiago-fast", 0, FROM_THE_PATH),
        *(pytest.param(name, 0, FROM_THE_PATH, marks=pytest.mark.slow) for name in ("varga7-fast", "khan8-q1")),
        pytest.param("varga7-random", 2_000_000, Search(), marks=pytest.mark.slow),
    ],
)
def test_records_are_reproduced(name, seed, how):
    scenario = ikgym.scenarios.get(name)
    known = best_known.lookup(scenario, seed)
    assert solve(scenario, seed, how).cost == pytest.approx(known.cost, rel=1e-6, abs=best_known.MEANINGLESS)


# An independent optimiser: CasADi's IPOPT.


@pytest.mark.parametrize(
    ("scenario", "seed"),
    [
        (short(steps=20), 0),
        (short("varga7-pose-random", 20), 2_000_001),
        pytest.param(short("varga7-pose-random", 150), 2_000_006, marks=pytest.mark.slow),
    ],
)
def test_agrees_with_ipopt(scenario, seed):
    """An independent optimiser, from the optimum, from the nominal joint path and, on a short piece, from rest."""
    problem, nominal = Problem.of(scenario), scenario.nominal(seed)
    optimum = solve(scenario, seed, Search(starts=20, generations=0))
    horizon = Horizon(scenario.nominal_joint_path(seed)[0], nominal[1:])
    assert plan_cost(problem, horizon, optimum.q) == pytest.approx(optimum.cost, rel=1e-9)
    starts = {"ours": optimum.q, "the nominal joint path": scenario.nominal_joint_path(seed)[1:]}
    if scenario.steps == 20:
        starts["rest"] = None
    for name, start in starts.items():
        plan = CasadiHorizon(problem, len(nominal) - 1).solve(horizon, start)
        assert plan.converged, name
        assert plan.cost == pytest.approx(optimum.cost, rel=1e-8), name
        assert_allclose(plan.q, optimum.q, rtol=0, atol=1e-6, err_msg=name)
