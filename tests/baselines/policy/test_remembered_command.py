"""Policies under acceleration limits keep them from their last command, whatever joint velocity they observe."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.controller import Drives
from baselines.episodes import rollouts
from baselines.policy import Problem
from baselines.policy_kernels import sent_rows
from ikgym.kernels import threads
from ikgym.simulator import Simulator
from tests.comparison import identical

SCENARIO = ikgym.scenarios.get("panda-random").replace(steps=8)
POLICIES = ("qp", "qp_path", "sns", "rhc", "rhc_foresight", "agent_track", "offset_free:policy=qp")


def made(text):
    name, parameters = baselines.registry.parse_policy(text)
    return baselines.make(name, SCENARIO, **parameters)


def played(policy, rows, spoil):
    """Actions and states of some rows on an ideal plant, with the joint velocities that they are shown spoilt."""
    envs = gym.make_vec("RedundantIK-v0", num_envs=rows, scenario=SCENARIO, preview=policy.preview)
    seen, state = envs.reset(seed=0)[0], None
    for k in range(SCENARIO.steps - 1):
        shown = dict(seen, qdot=seen["qdot"] + spoil) if k > 0 else seen
        action, state = policy.predict(shown, state)
        seen = envs.step(action)[0]
        yield action, state, seen["qdot"]


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("text", POLICIES)
def test_an_observed_velocity_changes_nothing_after_the_first_step(text, shared, monkeypatch):
    policy = made(text)
    if shared:
        monkeypatch.setattr(threads, "count_cores", lambda: 2)
        monkeypatch.setattr(type(policy), "grain", 1)
    true, spoilt = played(policy, 3, 0.0), played(policy, 3, 0.3)
    for (action, state, qdot), (other, same, _) in zip(true, spoilt, strict=True):
        assert identical(action, other)
        assert identical(state, same)
        assert identical(state[-1], qdot)  # an ideal plant does what is remembered


@pytest.mark.parametrize("text", POLICIES)
def test_the_observed_velocity_counts_where_an_episode_begins(text):
    policy = made(text)
    env = ikgym.RedundantIKEnv(SCENARIO, preview=policy.preview)
    seen, _ = env.reset(seed=0)
    moving = dict(seen, qdot=0.2 * SCENARIO.velocity_limit)
    first, _ = policy.predict(moving)
    _, state = policy.predict(seen)
    assert identical(policy.predict(moving, state, True)[0], first)
    assert not identical(policy.predict(moving, state)[0], first)


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("text", ["qp", "qp_path", "sns", "predicted:policy=qp", "smoothed:policy=sns"])
def test_with_limits_of_jerk_rows_do_not_depend_on_each_other(text, shared, monkeypatch):
    """Also where one of several episodes begins anew: the changes of commands are remembered row by row."""
    scenario, rows = SCENARIO.replace(jerk_limit=2000.0), 3
    name, parameters = baselines.registry.parse_policy(text)
    policy = baselines.make(name, scenario, **parameters)
    if shared:
        monkeypatch.setattr(threads, "count_cores", lambda: 2)
        for one in (policy, getattr(policy, "inner", policy)):
            monkeypatch.setattr(type(one), "grain", 1)
    envs = gym.make_vec("RedundantIK-v0", num_envs=rows, scenario=scenario, preview=policy.preview)
    seen, state, alone = envs.reset(seed=0)[0], None, [None] * rows
    for k in range(scenario.steps - 1):
        starting = np.array([False, k == 4, False])
        seen = dict(seen, nominal=seen["nominal"] + 0.02)  # far enough away that the limits are met
        action, state = policy.predict(seen, state, starting)
        for row in range(rows):
            shown = {key: values[row] for key, values in seen.items()}
            single, alone[row] = policy.predict(shown, alone[row], starting[row])
            assert identical(single, action[row])
            assert identical([part[0] for part in alone[row]], [part[row] for part in state])
        seen = envs.step(action)[0]
    assert np.abs(action).max() > 0.01


@pytest.mark.parametrize("name", ["qp", "sns"])
def test_errors_are_corrected_with_a_limit_of_jerk_alone(name):
    """As of an arm from a URDF file, which states no acceleration limit."""
    arm = SCENARIO.arm.replace(acceleration_limit=None)
    scenario = ikgym.scenarios.get("panda-circle").replace(arm=arm, jerk_limit=5000.0, steps=400)
    assert baselines.track(scenario, name).position_error[-100:].max() < 1e-5


def test_policies_without_acceleration_limits_remember_nothing():
    assert not baselines.make("dls", SCENARIO).remembers_command
    assert not baselines.make("qp", "iiwa14-circle").remembers_command
    assert baselines.make("rhc", "varga7-fast", rate_weight=1e-3).remembers_command
    policy = made("qp")
    state = policy.predict(ikgym.RedundantIKEnv(SCENARIO).reset(seed=0)[0])[1]
    assert identical(tuple(policy.memory_of(state)), state[2:-1])


@pytest.mark.parametrize("name", ["panda-random", "varga7-fast"])
def test_the_remembered_command_is_that_of_an_ideal_plant(name):
    """At stops, too, where the velocity is what is left of the way."""
    scenario, rng = ikgym.scenarios.get(name), np.random.default_rng(0)
    arm, rows, n = scenario.arm, 20, scenario.arm.joints
    simulator = Simulator(scenario, rows, 1)
    low, high = np.maximum(arm.lower, -3.0), np.minimum(arm.upper, 3.0)
    starts = np.where(rng.random((rows, n)) < 0.5, high - 1e-4, low + rng.random((rows, n)) * (high - low))
    simulator.reset(np.ones(rows, bool), [np.random.default_rng(k) for k in range(rows)], starts=starts)
    last, model = np.zeros((rows, n)), Problem.of(scenario).kernel_model
    for _ in range(20):
        q = simulator.observe().q.copy()
        action = np.abs(rng.uniform(-1, 1, (rows, n))).astype(np.float32)
        sent_rows(model, q, action, last)
        assert identical(last, simulator.step(action).qdot)


@pytest.mark.parametrize("name", ["qp", "sns"])
def test_on_late_drives_the_limits_are_kept_from_the_command(name):
    """With the observed velocity the error is some millimetres (rms), and grows."""
    plant = ikgym.Plant(command_delay=2, bandwidth=62.9)
    scenario = ikgym.scenarios.get("panda-random").replace(plant=plant, steps=700)
    episodes = rollouts(scenario, baselines.make(name, scenario), ikgym.scenarios.seeds("validation", 4))
    assert np.sqrt(np.mean([episode.position_error**2 for episode in episodes])) < 1e-4


def test_a_controller_keeps_the_limits_from_its_last_command():
    scenario, rng = ikgym.scenarios.get("panda-circle"), np.random.default_rng(0)
    loops = [baselines.Controller(scenario, "qp", Drives()) for _ in range(2)]
    q, reference, last = scenario.first_q(scenario.episode(0)), scenario.nominal(0, 60), np.zeros(7)
    for k in range(50):
        measured = last + (rng.uniform(-0.3, 0.3, 7) if k > 0 else 0.0)
        plain = loops[0].step(q, None, reference[k + 1 :][: loops[0].ahead])
        assert identical(loops[1].step(q, None, reference[k + 1 :][: loops[1].ahead], qdot=measured), plain)
        q, last = q + scenario.dt * plain, plain
