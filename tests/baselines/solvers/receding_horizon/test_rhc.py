"""The receding horizon against IPOPT and gradient descent, its limits, and what it does along episodes."""

import dataclasses

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.status import Status
from tests.baselines.solvers.receding_horizon.data import trapezoidal_weights
from tests.comparison import identical
from tests.independent.casadi_horizon import CasadiHorizon
from tests.independent.numpy_horizon import Horizon, plan_cost

VARGA = ["varga7-fast", "varga7-slow", "varga7-literal-fast", "varga7-literal-slow"]
# The policy stops at 1e-7 of the cost, IPOPT at 1e-10 of its optimality; below costs of 1e-3 an absolute 1e-9 counts.
RELATIVE, ABSOLUTE = 1e-6, 1e-9
FAR = 10**6


def observe(problem, q, nominal, qdot=None, remaining=FAR):
    """A batch of observations from joint coordinates and what lies ahead."""
    q = np.atleast_2d(q)
    return {
        "q": q,
        "qdot": np.zeros_like(q) if qdot is None else np.atleast_2d(qdot),
        "pose": problem.task.coordinates(*problem.model.forward(q)),
        "nominal": np.reshape(nominal, (len(q), -1, problem.task.size)),
        "remaining": np.full((len(q), 1), float(remaining)),
    }


def grid_horizon(policy, q, nominal, left=FAR):
    """What the policy minimises."""
    end = min(int(policy.offsets[-1]), left)
    at = np.append(policy.offsets[policy.offsets < end], end)
    weights = trapezoidal_weights(at)
    weights[-1] *= policy.terminal_weight
    joints = np.broadcast_to(policy.joint_weights, q.shape) / np.min(policy.joint_weights)
    return Horizon(q, nominal[at - 1], np.diff(at, prepend=0).astype(float), weights, joint_weights=joints)


def states_near(scenario, ahead, count, far, seed=0):
    """States on the nominal joint path, or off it by up to so much, and what lies ahead of them."""
    rng = np.random.default_rng(seed)
    joints, nominal = scenario.nominal_joint_path(0), scenario.nominal(0, preview=ahead)
    steps = rng.integers(scenario.steps, size=count)
    away = rng.normal(size=(count, scenario.joints)) * far * 10.0 ** rng.uniform(-1.0, 0.0, (count, 1))
    return joints[steps] + away, np.stack([nominal[k + 1 : k + 1 + ahead] for k in steps])


def planned(policy, q, nominal, state=None, **more):
    """Costs of the plans for a batch, by plain NumPy, and the state after them."""
    _, state = policy.predict(observe(policy.problem, q, nominal, **more), state)
    left = more.get("remaining", FAR)
    horizons = [grid_horizon(policy, a, b, left) for a, b in zip(q, nominal, strict=True)]
    plans = [plan[: h.knots] for plan, h in zip(policy.plan(state), horizons, strict=True)]
    costs = [plan_cost(policy.problem, h, plan) for h, plan in zip(horizons, plans, strict=True)]
    return np.array(costs), horizons, plans, state


def compare(policy, solver, costs, horizons, plans):
    """Never above IPOPT's minimum, and where IPOPT starts from the plan there is nothing left to gain."""
    for cost, horizon, plan in zip(costs, horizons, plans, strict=True):
        for start in (None, plan):
            best = solver.solve(horizon, start)
            assert cost <= best.cost * (1.0 + RELATIVE) + ABSOLUTE, (horizon.q, start is None)


def along_an_episode(policy, scenario, q, first, steps):
    """Costs of the plans while the policy moves the arm from q, its memory kept."""
    nominal, state, ahead = scenario.nominal(0, preview=policy.preview), None, policy.preview
    qdot = np.zeros_like(q)
    for k in range(first, first + steps):
        view = nominal[k + 1 : k + 1 + ahead]
        costs, horizons, plans, state = planned(policy, q[None], view[None], state, qdot=qdot)
        yield costs, horizons, plans
        qdot = (plans[0][0] - q) / policy.problem.dt
        q = plans[0][0]


def check_against_ipopt(name, horizon, count, **parameters):
    scenario = ikgym.scenarios.get(name)
    policy = baselines.make("rhc", scenario, horizon=horizon, **parameters)
    solver = CasadiHorizon(policy.problem, len(policy.offsets))
    for far, seed in ((0.0, 1), (1e-2, 2)):
        q, nominal = states_near(scenario, policy.preview, count, far, seed)
        costs, horizons, plans, state = planned(policy, q, nominal)
        assert set(policy.report(state).status) == {Status.CONVERGED}
        compare(policy, solver, costs, horizons, plans)
    joints = scenario.nominal_joint_path(0)
    for first in (0, 900):
        steps = along_an_episode(policy, scenario, joints[first] + 2e-3, first, count // 2)
        for costs, horizons, plans in steps:
            compare(policy, solver, costs, horizons, plans)


@pytest.mark.parametrize("name", ["varga7-fast", "varga7-literal-slow"])
def test_plans_are_as_cheap_as_ipopts(name):
    check_against_ipopt(name, 10, 2)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "horizon"), list(zip(VARGA, (3, 10, 30, 30), strict=True)))
def test_plans_are_as_cheap_as_ipopts_at_many_states(name, horizon):
    check_against_ipopt(name, horizon, 20 if horizon < 30 else 8)  # of each of four kinds


@pytest.mark.parametrize(
    ("name", "horizon", "count"),
    [("faitli3-stretched", 8, 4), ("zhang6-lspb", 6, 4), ("khan8-q1", 4, 2), ("faitli3-shoulder", 8, 4)],
)
def test_other_arms_and_tasks(name, horizon, count):
    scenario = ikgym.scenarios.get(name)
    policy = baselines.make("rhc", scenario, horizon=horizon)
    solver = CasadiHorizon(policy.problem, horizon - 1)
    nominal, rng = scenario.nominal(0, preview=horizon), np.random.default_rng(0)
    start = scenario.nominal_joint_path(0)
    q = np.tile(scenario.start, (count, 1)) if start is None else start[np.arange(count) * 200]
    steps = np.zeros(count, int) if start is None else np.arange(count) * 200
    q = q + rng.normal(size=q.shape) * 1e-3
    ahead = np.stack([nominal[k + 1 : k + horizon] for k in steps])
    costs, horizons, plans, state = planned(policy, q, ahead)
    assert set(policy.report(state).status) <= {Status.CONVERGED, Status.SATURATED}
    compare(policy, solver, costs, horizons, plans)


@pytest.mark.parametrize(
    "parameters",
    [
        {"horizon": 31, "move_blocks": 8, "terminal_weight": 20.0},
        {"horizon": 9, "terminal_weight": 0.0},
        {"horizon": 9, "joint_weights": (6.0, 3.0, *[300.0] * 4, 3.0)},
    ],
)
def test_blocked_and_weighted_horizons(parameters):
    scenario = ikgym.scenarios.get("varga7-fast")
    policy = baselines.make("rhc", scenario, **parameters)
    q, nominal = states_near(scenario, policy.preview, 2, 1e-2)
    costs, horizons, plans, state = planned(policy, q, nominal)
    assert set(policy.report(state).status) == {Status.CONVERGED}
    compare(policy, CasadiHorizon(policy.problem, len(policy.offsets)), costs, horizons, plans)


def rate_cost(policy, horizon, plan):
    """What the changes of velocity of a plan cost."""
    speeds = np.diff(np.vstack([horizon.q, plan]), axis=0) / (horizon.lengths[:, None] * policy.problem.dt)
    changes = np.diff(np.vstack([horizon.qdot, speeds]), axis=0)
    spans = 0.5 * (horizon.lengths + np.append(1.0, horizon.lengths[:-1]))
    return policy.rate_weight * np.sum(changes**2 / spans[:, None])


@pytest.mark.parametrize("parameters", [{"horizon": 8}, {"horizon": 31, "move_blocks": 8}])
def test_plans_whose_changes_of_velocity_cost_something_are_as_cheap_as_ipopts(parameters):
    scenario = ikgym.scenarios.get("varga7-fast")
    policy = baselines.make("rhc", scenario, rate_weight=5.0, **parameters)
    q, nominal = states_near(scenario, policy.preview, 3, 1e-2)
    qdot = np.random.default_rng(1).normal(size=q.shape)
    costs, horizons, plans, _ = planned(policy, q, nominal, qdot=qdot)
    solver = CasadiHorizon(policy.problem, len(policy.offsets), rate_weight=5.0)
    for cost, horizon, plan, before in zip(costs, horizons, plans, qdot, strict=True):
        moving = dataclasses.replace(horizon, qdot=before)
        best = solver.solve(moving, plan)
        assert best.converged
        wanted = best.cost + rate_cost(policy, moving, best.q)
        assert cost + rate_cost(policy, moving, plan) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("blocks", [None, 6])
@pytest.mark.parametrize("left", [1, 5])
def test_the_horizon_ends_with_the_episode(left, blocks):
    scenario = ikgym.scenarios.get("varga7-fast")
    policy = baselines.make("rhc", scenario, horizon=15, stop_at_end=True, move_blocks=blocks)
    q, nominal = states_near(scenario, 14, 3, 1e-2)
    costs, horizons, plans, _ = planned(policy, q, nominal, remaining=left)
    compare(policy, CasadiHorizon(policy.problem, horizons[0].knots), costs, horizons, plans)
    # What lies behind the end changes nothing, and without the parameter it would.
    moved = nominal.copy()
    moved[:, left:] += 0.1
    for ends in (True, False):
        policy = baselines.make("rhc", scenario, horizon=15, stop_at_end=ends, move_blocks=blocks)
        answers = [policy.predict(observe(policy.problem, q, x, remaining=left))[0] for x in (nominal, moved)]
        assert identical(*answers) == ends


def limited(name, speed=20.0, share=0.0):
    """A scenario with slow joints, or with joint limits inside the range of its nominal joint path."""
    scenario = ikgym.scenarios.get(name).replace(velocity_limit=speed)
    if share == 0.0:
        return scenario
    joints = scenario.nominal_joint_path(0)
    lower, upper = np.add(np.quantile(joints, [share, 1.0 - share], axis=0), [[-1e-3], [1e-3]])
    arm = scenario.arm.replace(lower=lower, upper=upper)
    return scenario.replace(arm=arm, model=arm)


@pytest.mark.parametrize(
    ("scenario", "horizon", "far"),
    [
        (limited("varga7-fast", speed=5.0), 10, 1e-2),
        (limited("varga7-fast", share=0.1), 6, 1e-2),
        pytest.param(limited("varga7-fast", speed=20.0), 3, 1e-1, marks=pytest.mark.slow),
    ],
    ids=["slow joints", "joint limits", "far away"],
)
def test_limits_are_kept_and_agree_with_ipopt(scenario, horizon, far):
    policy = baselines.make("rhc", scenario, horizon=horizon)
    q, nominal = states_near(scenario, horizon - 1, 8, far, seed=3)
    lower, upper = policy.problem.model.lower, policy.problem.model.upper
    q = np.clip(q, lower, upper)
    costs, horizons, plans, _ = planned(policy, q, nominal)
    plans = np.array(plans)
    speeds = np.diff(np.concatenate([q[:, None], plans], axis=1), axis=1) / scenario.dt / scenario.velocity_limit
    assert abs(speeds).max() <= 1.0 + 1e-6
    assert (plans >= lower - 1e-6).all()
    assert (plans <= upper + 1e-6).all()
    # Limits that nothing presses on would test nothing.
    assert (abs(speeds) > 1.0 - 1e-6).any() or (np.minimum(plans - lower, upper - plans) < 1e-6).any()
    model, n = policy.problem.model, scenario.joints
    finite = {"lower": np.maximum(lower, -1e3), "upper": np.minimum(upper, 1e3), "acceleration_limit": np.full(n, 1e9)}
    bounded = dataclasses.replace(policy.problem, model=model.replace(**finite))
    solver, compared = CasadiHorizon(bounded, horizon - 1, limited=True), 0
    for cost, state, plan in zip(costs, horizons, plans, strict=True):
        best = solver.solve(state, plan)
        compared += best.converged
        assert cost == pytest.approx(best.cost, rel=RELATIVE, abs=ABSOLUTE) or not best.converged
    assert compared >= 4


def total(episode):
    return float((episode.tracking_cost + episode.velocity_cost).sum())


def test_one_newton_step_a_period_is_nearly_the_optimum():
    scenario = ikgym.scenarios.get("varga7-fast").replace(steps=800)
    whole, quick = (rollout(scenario, baselines.make("rhc", scenario, iterations=n), 0) for n in (None, 1))
    assert total(quick) == pytest.approx(total(whole), rel=0.01)
    assert set(whole.status) == {Status.CONVERGED}
    assert set(quick.iterations[1:]) == {1}


RESTARTED = {"horizon": 40, "iterations": 1, "move_blocks": 12, "starts": 4, "restart_steps": 5}


def pushed(policy):
    """Observations of three arms near the nominal path, and which of them begin an episode."""
    scenario, rng = ikgym.scenarios.get("varga7-fast"), np.random.default_rng(0)
    joints, nominal = scenario.nominal_joint_path(0), scenario.nominal(0, preview=policy.preview)
    for k in range(30):
        q = joints[k] + rng.normal(size=(3, 7)) * 1e-3
        ahead = np.stack([nominal[k + 1 : k + 1 + policy.preview]] * 3)
        yield observe(policy.problem, q, ahead, remaining=60 - k), np.array([k == 0, k % 7 == 0, k == 11])


@pytest.mark.parametrize("more", [{"stop_at_end": True}, {"iterations": None}, {"start_steps": 4, "recovery_steps": 3}])
def test_rows_of_a_batch_are_single_calls_with_restart_candidates_and_starts(more):
    policy = baselines.make("rhc", "varga7-fast", **{**RESTARTED, **more})
    states, batched = [None] * 3, None
    for view, start in pushed(policy):
        action, batched = policy.predict(view, batched, start)
        assert np.isfinite(action).all()
        for i in range(3):
            row = {key: value[i] for key, value in view.items()}
            single, states[i] = policy.predict(row, None if start[i] else states[i])
            assert identical(single, action[i])
            assert all(identical(a[0], b[i]) for a, b in zip(states[i], batched, strict=True))
    assert (policy.report(batched).iterations > 1).all()  # restart candidates among them


def test_seeds():
    scenario = ikgym.scenarios.get("varga7-fast").replace(steps=60)
    base = {"horizon": 200, "move_blocks": 16, "starts": 6, "start_steps": 0}
    policies = [baselines.make("rhc_foresight", scenario, **base, seed=seed) for seed in (0, 0, 1)]
    first, again, other = (rollout(scenario, policy, 0).q for policy in policies)
    assert identical(first, again)
    assert not identical(first, other)


def test_nothing_finite_gives_a_nan():
    """From absurdly far away, with targets out of reach, and at the singular home."""
    scenario = ikgym.scenarios.get("varga7-fast")
    for parameters in ({"horizon": 6}, {"horizon": 6, "iterations": 1}, {**RESTARTED, "horizon": 30}):
        policy = baselines.make("rhc", scenario, **parameters)
        nominal = np.tile(scenario.nominal(0)[0], (4, policy.preview, 1))
        nominal[1, :, 3:] = 1e3
        nominal[2, :, 3:] = 1e8
        q = np.zeros((4, 7))
        q[3] = 1e5
        state = None
        for _ in range(8):
            action, state = policy.predict(observe(policy.problem, q, nominal), state)
            assert np.isfinite(action).all()
            assert abs(action).max() <= 1.0
            assert set(policy.report(state).status) <= set(Status)


def test_status_and_iterations_are_said():
    scenario = ikgym.scenarios.get("varga7-fast")
    q, nominal = states_near(scenario, 29, 1, 1e-2)
    policy = baselines.make("rhc", scenario, iterations=1)
    _, state = policy.predict(observe(policy.problem, q, nominal))
    assert policy.report(state).status[0] == Status.CONVERGED  # the first plan of all is given its time
    _, state = policy.predict(observe(policy.problem, q + 0.01, nominal), state)
    assert policy.report(state) == (Status.ITERATION_LIMIT, 1)
