"""Receding horizons under limits of acceleration: their optima are IPOPT's, and the plant holds nothing back."""

import json
from pathlib import Path

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollouts
from tests.baselines.solvers.receding_horizon.newton.states import DT, KNOTS, State, horizon_of, problem_of
from tests.baselines.solvers.receding_horizon.test_rhc import observe
from tests.independent.numpy_horizon import beyond_limits, plan_cost
from tests.limited import limited

SEEDS = ikgym.scenarios.seeds("validation", 2)
GOLDEN = [
    (State(*map(np.array, (line["q"], line["qdot"], line["path"]))), line["cost"], line["at_limit"])
    for line in json.loads((Path(__file__).parent / "newton/golden/horizons.json").read_text())
]
SOME = GOLDEN[8:13]


def panda(steps=60, **changes):
    """A gentle motion: nominal velocities and accelerations stay below the limits."""
    return ikgym.scenarios.get("panda-random").replace(steps=steps, **changes)


def states(golden):
    """Observations of golden states, one row each, and their horizons."""
    problem = problem_of()
    horizons = [horizon_of(problem, state) for state, *_ in golden]
    q, qdot, nominal = (np.array([getattr(h, name) for h in horizons]) for name in ("q", "qdot", "nominal"))
    return problem, horizons, observe(problem, q, nominal, qdot)


@pytest.mark.parametrize("golden", [SOME, pytest.param(GOLDEN, marks=pytest.mark.slow)], ids=len)
def test_plans_are_ipopts_and_a_batch_is_its_rows(golden):
    """To convergence the plan is IPOPT's, at limits of all three kinds, and what is applied is its first velocity."""
    assert (np.array([at_limit for *_, at_limit in golden]) > 0).any(axis=0).all()
    problem, horizons, observation = states(golden)
    policy = baselines.get("rhc")(problem, horizon=KNOTS + 1, tolerance=1e-8)
    action, state = policy.predict(observation)
    assert (state[0] == 0).all()  # CONVERGED
    for plan, horizon, (_, cost, _), row in zip(policy.plan(state), horizons, golden, action, strict=True):
        assert plan_cost(problem, horizon, plan) == pytest.approx(cost, rel=1e-6)
        assert max(beyond_limits(problem, horizon, plan, braking=True).values()) < 1e-9
        velocity = row * problem.velocity_limit
        np.testing.assert_allclose(velocity, (plan[0] - horizon.q) / DT, atol=1e-6)
        assert (abs(velocity - horizon.qdot) <= DT * problem.model.acceleration_limit + 1e-6).all()
    for row in (0, 3):
        alone, memory = policy.predict({name: array[row] for name, array in observation.items()})
        np.testing.assert_array_equal(alone, action[row])
        np.testing.assert_array_equal(policy.plan(memory)[0], policy.plan(state)[row])


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("rhc", {"horizon": 10}),
        ("rhc", {"horizon": 60, "move_blocks": 12, "iterations": 1, "starts": 3, "restart_steps": 5}),
        ("rhc_foresight", {"horizon": 101}),
    ],
)
def test_on_a_gentle_path_nothing_is_held_back(name, parameters):
    scenario = panda()
    policy = baselines.make(name, scenario, **parameters)
    for episode in rollouts(scenario, policy, SEEDS):
        assert not episode.at_limit.any()
        changes = np.diff(episode.qdot, axis=0, prepend=0.0)
        assert (abs(changes) <= scenario.dt * scenario.arm.acceleration_limit + 1e-6).all()
        assert episode.position_error.max() < 1e-3


def test_a_short_horizon_stops_before_the_end_of_a_joint():
    """Towards a stop an arm brakes within its acceleration, though that takes longer than the horizon."""
    scenario = panda(steps=150)
    arm, path = scenario.arm, scenario.nominal_joint_path(SEEDS[0])
    j = int(np.argmax(np.abs(path[150] - path[0])))
    upper, lower = arm.upper.copy(), arm.lower.copy()
    middle = 0.5 * (path[0, j] + path[150, j])
    (upper if path[150, j] > path[0, j] else lower)[j] = middle
    narrow = arm.replace(upper=upper, lower=lower, home=None)
    motion = scenario.trajectory.sample(np.random.default_rng(SEEDS[0]))
    stopping = scenario.replace(arm=narrow, trajectory=motion, start=path[0])
    policy = baselines.make("rhc", stopping, horizon=6)
    (episode,) = rollouts(stopping, policy, SEEDS[:1])
    assert not episode.at_limit.any()
    assert abs(episode.q[:, j] - middle).min() < 1e-2


def test_velocities_of_a_plan_that_cannot_keep_them_are_cut():
    """Faster than can be stopped: the first velocity keeps the acceleration limit all the same, and it is said."""
    problem, _, observation = states(GOLDEN[:1])
    arm = problem.model
    observation["q"] = np.array([arm.upper - 1e-3])
    observation["qdot"] = np.array([0.9 * arm.velocity_limit])
    policy = baselines.get("rhc")(problem, horizon=KNOTS + 1)
    action, state = policy.predict(observation)
    change = action[0] * problem.velocity_limit - observation["qdot"][0]
    assert (abs(change) <= DT * arm.acceleration_limit + 1e-6).all()
    assert state[0][0] != 0


def test_joints_without_a_limit_are_free():
    """One joint with a limit of acceleration, the others without: the plant holds none of them back."""
    scenario = limited()
    finite = np.isfinite(scenario.arm.acceleration_limit)
    assert finite.any()
    assert not finite.all()
    policy = baselines.make("rhc", scenario, horizon=6)
    for episode in rollouts(scenario, policy, SEEDS):
        assert not episode.at_limit.any()
        assert np.isfinite(episode.qdot).all()


@pytest.mark.parametrize(("scenario", "preset"), [("varga7-fast", (1, 23, 20, 10)), ("tiago-turn", (3, 1, 0, 0))])
def test_what_the_preset_is_depends_on_the_arm_parameter_by_parameter(scenario, preset):
    names = "iterations", "starts", "restart_steps", "start_steps"
    for given in ({}, {"starts": 3}, {"iterations": 2, "restart_steps": 30}):
        policy = baselines.make("rhc_foresight", scenario, **given)
        assert policy.parameters.items() >= (dict(zip(names, preset, strict=True)) | given).items()


def test_foresight_stays_within_limits_of_position_and_velocity():
    """TIAGo's torso moves by 0.07 m/s; multipliers err by 43 µm here with one Newton step a period."""
    scenario = ikgym.scenarios.get("tiago-raster").replace(steps=400)
    (episode,) = rollouts(scenario, baselines.make("rhc_foresight", scenario), (0,))
    assert not episode.at_limit.any()
    assert episode.position_error.max() < 1e-5


def test_the_preset_looks_as_far_ahead_in_time_at_any_control_period():
    """1.5 s, and never over a stretch longer than 0.1 s at once; a knot at each step where control is slower."""
    for dt in (1e-3, 2e-3, 4e-3, 0.02, 0.2):
        policy = baselines.make("rhc_foresight", ikgym.scenarios.get("panda-turn").replace(dt=dt))
        times = dt * np.append(0, policy.offsets)
        assert times[-1] == pytest.approx(1.5, abs=0.51 * dt)
        assert np.diff(times).max() <= max(dt, 0.1) + dt
