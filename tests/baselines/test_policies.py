"""The contract of all policies, over the registry; bad input is in test_faults.py."""

import copy
import dataclasses
import functools
import itertools
import json
import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Mapping

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

import baselines
import ikgym
from baselines.policy import Problem, Solution, SolverPolicy, statuses
from baselines.policy.compiled import CompiledPolicy
from baselines.registry import get
from baselines.solvers.references.follow_nominal import PrivilegedPath
from baselines.status import Status
from baselines.wrapper import Wrapper
from ikgym.exceptions import InvalidInputError
from ikgym.kernels import threads
from ikgym.kernels.outcome import OBSERVED
from ikgym.plant import DrawnPlant
from ikgym.plant.draw import Draws
from ikgym.plant.rows import PlantRows
from ikgym.simulator import Simulator
from tests.baselines.making import made, two_actions, usual
from tests.comparison import identical

STEPS = 6

#: A task that no scenario of the catalogue has.
AXIS = ikgym.scenarios.get("zhang6-lspb").replace(name="zhang6-axis", task=ikgym.tasks.get("axis"))

#: The usual scenario, and one for each other task, and for each kind of limits.
SCENARIOS = ("zhang3-helix", "khan8-q7q8", "tiago-raster", AXIS.name)
#: What a policy knows of a scenario.
PROBLEM = {"model", "task", "cost", "dt", "jerk_limit", "velocity_limit", "surroundings", "obstacles_shown"}
every_policy = pytest.mark.parametrize("name", baselines.names())
every_contender = pytest.mark.parametrize("name", [name for name in baselines.names() if not get(name).reference])


@functools.cache
def scenario(name):
    return (AXIS if name == AXIS.name else ikgym.scenarios.get(name)).replace(steps=STEPS)


@functools.cache
def policy_for(name, on):
    """The policy on a shortened scenario, or None where it does not suit; one for all tests, as policies are frozen."""
    seed = {"seed": 1} if issubclass(get(name), PrivilegedPath) and scenario(on).random else {}
    try:
        return made(name, scenario(on), **seed)
    except InvalidInputError:
        return None


def observations(on, preview, rows):
    """Observations on and off the nominal path, new arrays each time."""
    for observation in seen(on, preview, rows):
        yield {key: value.copy() for key, value in observation.items()}


@functools.cache
def seen(on, preview, rows):
    """What most policies are shown is the same: it is played once."""
    envs = gym.make_vec("RedundantIK-v0", num_envs=rows, scenario=scenario(on), preview=preview)
    envs.reset(seed=0)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-0.05, 0.05, (STEPS - 1, *envs.action_space.shape)).astype(np.float32)
    return [envs.step(action)[0] for action in actions]


def row(observation, i):
    return {key: value[i] for key, value in observation.items()}


@pytest.mark.parametrize("on", ["usual", "iiwa14-random", *SCENARIOS])
@every_policy
def test_batch_equals_single_calls_and_memory_goes_by_rows(name, on):
    if on != "usual" and get(name).reference != (on == "iiwa14-random"):  # references play paths, random ones or not
        return
    policy = policy_for(name, on := usual(name) if on == "usual" else on)
    assert policy is not None or on != usual(name)
    if policy is None:
        return
    rows, box = 3, ikgym.RedundantIKEnv(scenario(on)).action_space
    states, batched = [None] * rows, None
    for k, observation in enumerate(observations(on, policy.preview, rows)):
        # Row 1 begins a new episode at every other step, row 2 at the third.
        start = np.array([k == 0, k % 2 == 0, k in (0, 2)])
        before, kept = copy.deepcopy(observation), copy.deepcopy(batched)
        action, after = policy.predict(observation, state=batched, episode_start=start)
        again, same = policy.predict(observation, batched, start, deterministic=False)
        assert identical(action, again)
        assert identical(after, same)
        assert identical(observation, before)
        assert batched is None or identical(batched, kept)
        batched, report = after, policy.report(after)
        assert {*report.status} <= {*Status}
        assert (report.iterations >= 0).all()
        for i in range(rows):
            single, states[i] = policy.predict(
                row(observation, i), state=None if start[i] else states[i], episode_start=np.array([False])
            )
            assert single in box
            assert identical(single, action[i])
            assert all(identical(a[0], b[i]) for a, b in zip(states[i], batched, strict=True))


@every_policy
def test_rows_that_are_shared_out_to_threads_are_the_same(monkeypatch, name):
    policy, callers, solve = policy_for(name, usual(name)), set(), get(name).solve

    def watched(self, batch, memory):
        callers.add(threading.get_ident())
        return solve(self, batch, memory)

    monkeypatch.setattr(type(policy), "solve", watched)
    monkeypatch.setattr(threads, "count_cores", lambda: 2)
    whole, shared = None, None
    for k, observation in enumerate(itertools.islice(observations(usual(name), policy.preview, 5), 3)):
        start = np.array([k == 0, k == 2, False, False, k == 1])
        monkeypatch.setattr(type(policy), "grain", 100)
        expected, whole = policy.predict(observation, whole, start)
        monkeypatch.setattr(type(policy), "grain", 1)
        action, shared = policy.predict(observation, shared, start)
        assert identical(action, expected)
        assert identical(shared, whole)
    assert len(callers) > 1


@every_policy
def test_memory_has_names_and_what_is_returned_is_fresh(name):
    policy = policy_for(name, usual(name))
    outer = policy.own_memory(1) if isinstance(policy, Wrapper) else policy.memory(1)
    assert outer == () or hasattr(outer, "_fields")
    state, returned = None, []
    for observation in observations(usual(name), policy.preview, 2):
        action, state = policy.predict(observation, state, np.array([False, True]))
        returned += [action, *state[2:], *observation.values()]
        # The state is flat, and its memory has the names that `memory` gives it.
        assert type(state) is tuple
        assert type(policy.memory_of(state)) is type(policy.memory(1))
        last = 1 if policy.remembers_command else 0
        assert identical(tuple(policy.memory_of(state)), state[2 : len(state) - last])
    for k, array in enumerate(returned):
        assert not any(np.shares_memory(array, other) for other in returned[k + 1 :])


@every_policy
def test_what_is_not_finite_is_refused_and_the_state_stays(name):
    policy = policy_for(name, usual(name))
    good = next(observations(usual(name), policy.preview, 2))
    _, state = policy.predict(good)
    kept = copy.deepcopy(state)
    for key in OBSERVED:
        spoilt = {**good, key: good[key].copy()}
        spoilt[key].flat[-1] = np.nan
        for shown, before in ((spoilt, state), (row(spoilt, 1), None)):
            with pytest.raises(InvalidInputError, match="observation: expected finite numbers, got NaN or infinity"):
                policy.predict(shown, before)
    assert identical(state, kept)


@every_policy
def test_no_rows_are_a_batch(name):
    policy = policy_for(name, usual(name))
    nothing = {key: value[:0] for key, value in next(observations(usual(name), policy.preview, 1)).items()}
    action, state = policy.predict(nothing)
    assert action.shape == (0, policy.problem.model.joints)
    assert all(len(array) == 0 for array in policy.predict(nothing, state)[1])


@every_contender
def test_any_policy_inside_smoothed(name):
    """At its first step, the inner policy sees what it would see alone; its state is found in the wrapper's."""
    short = scenario(usual(name))
    alone, policy = made(name, short), baselines.make("smoothed", short, policy=name)
    assert policy.preview == alone.preview
    assert policy.options == alone.parameters
    outer, inside = policy.split(policy.memory(3))
    assert outer._fields == ("known", "q", "qdot", "smooth")
    assert identical(tuple(inside), tuple(alone.initial_memory(3)))
    observation = next(observations(usual(name), policy.preview, 3))
    action, state = policy.predict(observation)
    assert [array.shape for array in state[2:]] == [array.shape for array in (*outer, *inside)]
    inner_state = policy.inner_state(state)
    assert identical(policy.report(state), alone.report(inner_state))
    assert identical(policy.diagnostics(state), alone.diagnostics(inner_state))
    np.testing.assert_array_equal(action, 0.0)
    assert identical(inner_state, alone.predict(observation)[1])


def converges(policy):
    """Whether anything is tested against a tolerance: all other policies cannot know whether they have converged."""
    return "tolerance" in policy.parameters or (isinstance(policy, Wrapper) and converges(policy.inner))


@every_policy
def test_only_those_with_a_tolerance_say_that_they_have_converged(name):
    """A formula was applied, on its path or meters away from it."""
    on = usual(name) if get(name).rival else "varga7-random"
    policy = policy_for(name, on)
    if policy is None or converges(policy):
        return
    on_path = next(observations(on, policy.preview, 1))
    for observation in (on_path, {**on_path, "nominal": on_path["nominal"] + 1.0}):
        _, state = policy.predict(observation)
        assert policy.report(state).status[0] > Status.CONVERGED


def reachable(thing, seen=None):
    """All objects that an object holds, however deep."""
    seen = {} if seen is None else seen
    if id(thing) in seen or isinstance(thing, (str, bytes, type, np.ndarray)):
        return seen.values()
    seen[id(thing)] = thing
    inside = list(getattr(thing, "__dict__", {}).values())
    if isinstance(thing, Mapping):
        inside += thing.values()
    elif isinstance(thing, (tuple, list, set)):
        inside += thing
    for value in inside:
        reachable(value, seen)
    return seen.values()


HIDDEN = (ikgym.Scenario, gym.Env, gym.vector.VectorEnv, Simulator, ikgym.Plant, DrawnPlant, Draws, PlantRows)


@every_contender
def test_a_policy_holds_the_model_and_never_the_arm_or_its_plant(name):
    on = next(on for on in ("khan8-q7q8", usual(name)) if policy_for(name, on))  # the first has another arm
    policy = policy_for.__wrapped__(name, on)  # a new one: what it compiles when it is asked is a maze of numba's
    for thing in reachable(policy):
        assert not isinstance(thing, HIDDEN)
        assert not isinstance(thing, ikgym.Arm) or thing is scenario(on).model


def test_that_guard_would_notice():
    told = scenario("iiwa14-random").replace(plant=ikgym.Plant(zero=0.1))

    @dataclasses.dataclass(frozen=True, eq=False)
    class Told(get("dls")):
        plant: object = dataclasses.field(kw_only=True, default=None)

    policy = Told(Problem.of(told), plant=told.drawn_plant(1))
    assert any(isinstance(thing, HIDDEN) for thing in reachable(policy))


@every_contender
def test_the_arm_and_the_plant_that_move_change_no_answer(monkeypatch, name):
    """Same observations, same model, another arm and another plant, which nobody may ask for what it draws."""
    on = next(on for on in ("khan8-q7q8", "iiwa14-random", usual(name)) if policy_for(name, on))
    exact = scenario(on)
    plant = ikgym.Plant(zero=0.1, link=0.1, axis=0.1, payload=0.1, bandwidth=(1, 9), command_delay=3, q_noise=0.1)
    arm = exact.arm.replace(name="other", offsets=1.001 * exact.arm.offsets)

    def asked(*_):
        raise AssertionError(f"{name} asks for the true plant")

    monkeypatch.setattr(ikgym.Scenario, "drawn_plant", asked)
    monkeypatch.setattr(Draws, "__init__", asked)
    other = exact.replace(arm=arm, model=exact.model, plant=plant)
    policies = [baselines.make(name, which) for which in (exact, other)]
    assert policies[0].problem.model is policies[1].problem.model is exact.model
    assert {f.name for f in dataclasses.fields(Problem)} == PROBLEM
    states = [None, None]
    for observation in observations(on, policies[0].preview, 2):
        answers = [p.predict(observation, state) for p, state in zip(policies, states, strict=True)]
        assert identical(*answers)
        states = [state for _, state in answers]


@every_policy
def test_works_inside_evaluate_policy_with_several_environments(name):
    short = ikgym.scenarios.get(usual(name)).replace(steps=12)
    policy = made(name, short)

    def make():
        return Monitor(gym.make("RedundantIK-v0", scenario=short, preview=policy.preview))

    several, lengths = evaluate_policy(policy, DummyVecEnv([make] * 3), 6, return_episode_rewards=True)
    alone, _ = evaluate_policy(policy, make(), 1, return_episode_rewards=True)
    assert lengths == [12] * 6
    # A memory that were not cleared would show in the second episodes.
    assert set(several) == set(alone)


@every_policy
def test_policies_are_frozen_copied_and_say_their_parameters(name):
    policy = policy_for(name, usual(name))
    assert policy.name == name
    assert set(policy.parameters) == set(policy.parameter_names())
    for parameter in policy.parameters:
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(policy, parameter, 0)
    again = baselines.make(name, scenario(usual(name)), **policy.parameters)
    assert again.parameters == policy.parameters
    first = row(next(observations(usual(name), policy.preview, 1)), 0)
    for other in (copy.deepcopy(policy), pickle.loads(pickle.dumps(policy))):
        arrays = [other.problem.velocity_limit, other.problem.model.offsets]
        arrays += [value for value in vars(other).values() if isinstance(value, np.ndarray)]
        assert not any(array.flags.writeable for array in arrays)
        assert identical(other.predict(first)[0], policy.predict(first)[0])


def test_plain_python_answers_as_the_compiled_kernels_do():
    """All compiled solvers of one step, two steps long; the receding horizons are tested with their kernels."""
    names = [n for n in baselines.names() if issubclass(get(n), CompiledPolicy) and "receding" not in get(n).__module__]
    code = (
        "import json, warnings; warnings.simplefilter('ignore')\n"
        "from tests.baselines.making import two_actions\n"
        f"print(json.dumps([two_actions(name) for name in {names}]))"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "MPLBACKEND": "Agg"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    for name, plain in zip(names, json.loads(done.stdout.splitlines()[-1]), strict=True):
        np.testing.assert_allclose(two_actions(name), plain, rtol=1e-7, atol=1e-5, err_msg=name)


def good(preview=2):
    return gym.make("RedundantIK-v0", preview=preview).reset()[0]


def test_what_exceeds_the_velocity_limit_is_said():
    """The environment sees the action cut already, so that the policy has to say so."""
    scenario = ikgym.scenarios.get("varga7-fast").replace(velocity_limit=1e-3)
    batch = {key: np.stack([value] * 2) for key, value in good().items()}
    batch["nominal"][1] = batch["pose"][1]  # nothing to do in this row
    action, state = baselines.make("dls", scenario).predict(batch)
    assert baselines.SolverPolicy.report(state).status.tolist() == [Status.SATURATED, Status.APPLIED]
    assert abs(action[0]).max() == 1.0


def test_long_compilation_of_a_policy_is_announced(monkeypatch, caplog):
    shown = good()  # may compile the simulation
    caplog.clear()
    monkeypatch.setattr("baselines.policy.solver.compiled_classes", set())
    monkeypatch.setattr(ikgym.kernels.jit.announce.__wrapped__, "__defaults__", (0.01,))

    class Slow(Broken):
        name = "slow"

        def solve(self, batch, memory):
            time.sleep(0.1)
            return Solution(np.zeros_like(batch.q), memory, statuses(1), np.zeros(1, dtype=np.int64))

    policy = Slow(Problem.of(scenario("varga7-fast")))
    policy.predict(shown)
    assert caplog.text.count("Compiling the policy slow") == 1
    policy.predict(shown)
    assert caplog.text.count("Compiling") == 1


def test_float32_observations_do():
    policy = baselines.make("dls", "varga7-fast")
    action, _ = policy.predict({key: value.astype(np.float32) for key, value in good().items()})
    np.testing.assert_allclose(action, policy.predict(good())[0], atol=1e-5)


@dataclasses.dataclass(frozen=True, eq=False)
class Broken(SolverPolicy):
    """Answers NaN in its second row."""

    name = "broken"

    def memory(self, rows):
        return (np.zeros(rows),)

    def solve(self, batch, memory):
        qdot = np.zeros_like(batch.q)
        qdot[1] = np.nan
        return Solution(qdot, (memory[0] + 1.0,), statuses(len(qdot)), np.ones(len(qdot), dtype=np.int64))


def test_no_nan_leaves_a_policy():
    policy = Broken(Problem.of(scenario("varga7-fast")))
    batch = {key: np.stack([value] * 3) for key, value in good().items()}
    action, state = policy.predict(batch)
    np.testing.assert_array_equal(action, 0.0)
    assert policy.report(state).status.tolist() == [Status.APPLIED, Status.DIVERGED, Status.APPLIED]
    assert state[2].tolist() == [1.0, 0.0, 1.0]


def test_the_nominal_path_tracks_to_rounding_where_model_and_arm_agree():
    for on, seed in (("varga7-fast", None), ("varga7-random", 5)):
        short = ikgym.scenarios.get(on).replace(steps=50)
        policy = baselines.make("follow_nominal", short, seed=seed)
        env = gym.make("RedundantIK-v0", scenario=short, preview=1)
        observation, _ = env.reset(seed=seed)
        for _ in range(50):
            action, _ = policy.predict(observation)
            observation, *_, info = env.step(action)
            assert info["position_error"] < 1e-8  # what float32 actions leave
