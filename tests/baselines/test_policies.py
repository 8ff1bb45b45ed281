"""The contract of all policies, over the registry."""

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

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

import baselines
import ikgym
from baselines.policy import Batch, Problem, Solution, SolverPolicy, statuses
from baselines.policy.compiled import CompiledPolicy
from baselines.policy.parameters import checks
from baselines.registry import get
from baselines.solvers.references.follow_nominal import PrivilegedPath
from baselines.status import Status
from baselines.wrapper import Wrapper
from ikgym import parallel
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.kernels.outcome import OBSERVED
from ikgym.plant.draw import Draws
from ikgym.validation import number, whole_number
from tests.baselines.making import made, two_actions, usual
from tests.comparison import identical

STEPS = 6

#: A task that no scenario of the catalogue has.
AXIS = ikgym.scenarios.get("zhang6-lspb").replace(name="zhang6-axis", task=ikgym.tasks.get("axis"))

#: Beside the usual scenario one for each other task, and for each kind of limits.
SCENARIOS = ("zhang3-helix", "khan8-q7q8", "tiago-raster", AXIS.name)
#: What a policy is told of a scenario.
PROBLEM = {"model", "task", "cost", "dt", "velocity_limit", "surroundings", "obstacles_shown"}
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
    if get(name).reference and on in SCENARIOS:  # what they play is of one kind everywhere
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
    policy, threads, solve = policy_for(name, usual(name)), set(), get(name).solve

    def watched(self, batch, memory):
        threads.add(threading.get_ident())
        return solve(self, batch, memory)

    monkeypatch.setattr(type(policy), "solve", watched)
    monkeypatch.setattr(parallel, "cores", lambda: 2)
    whole, shared = None, None
    for k, observation in enumerate(itertools.islice(observations(usual(name), policy.preview, 5), 3)):
        start = np.array([k == 0, k == 2, False, False, k == 1])
        monkeypatch.setattr(type(policy), "grain", 100)
        expected, whole = policy.predict(observation, whole, start)
        monkeypatch.setattr(type(policy), "grain", 1)
        action, shared = policy.predict(observation, shared, start)
        assert identical(action, expected)
        assert identical(shared, whole)
    assert len(threads) > 1


@every_policy
def test_memory_has_names_and_what_is_returned_is_fresh(name, monkeypatch):
    policy = policy_for(name, usual(name))
    own = policy.own_memory(1) if isinstance(policy, Wrapper) else policy.memory(1)
    assert own == () or hasattr(own, "_fields")
    handed, solve = [], type(policy).solve

    def watched(self, batch, memory):
        handed.append(memory)
        return solve(self, batch, memory)

    monkeypatch.setattr(type(policy), "solve", watched)
    state, returned = None, []
    for observation in observations(usual(name), policy.preview, 2):
        action, state = policy.predict(observation, state, np.array([False, True]))
        returned += [action, *state[2:], *observation.values()]
        # The state is flat, and its memory has the names that `memory` gives it.
        assert type(state) is tuple
        assert type(policy.memory_of(state)) is type(policy.memory(1))
        assert identical(tuple(policy.memory_of(state)), state[2:])
    if isinstance(policy, CompiledPolicy):  # which calls its kernel with the memory's parts instead
        policy.solve(Batch(*[observation[key] for key in OBSERVED]), policy.memory_of(state))
        for k, array in enumerate(returned):
            assert not any(np.shares_memory(array, other) for other in returned[k + 1 :])
    assert {type(memory) for memory in handed} == {type(policy.memory(1))}


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
    alone, policy = made(name, short), baselines.make("smoothed", short, policy=name, feedback="measured")
    assert policy.preview == alone.preview
    assert policy.options == alone.parameters
    own, inside = policy.split(policy.memory(3))
    assert own._fields == ("known", "q", "qdot", "smooth")
    assert identical(tuple(inside), tuple(alone.memory(3)))
    observation = next(observations(usual(name), policy.preview, 3))
    action, state = policy.predict(observation)
    assert [array.shape for array in state[2:]] == [array.shape for array in (*own, *inside)]
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


@pytest.mark.parametrize("name", ["dls", "rhc_gradient", "smoothed"])
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


def bad_values(check):
    """Values that the check of a parameter refuses, by what it says itself."""
    if check.func in (number, whole_number):
        yield from ("x", np.nan, None, True)
        yield from (check.keywords[bound] for bound in ("above", "below") if bound in check.keywords)
        yield from (check.keywords["at_least"] - 1,) if "at_least" in check.keywords else ()
        yield from (check.keywords["at_most"] + 1,) if "at_most" in check.keywords else ()
        yield from (1.5,) if check.func is whole_number else (np.inf,)
    else:  # one of several words, or a truth value
        yield from ("nothing like it", 1, None)


@every_policy
def test_parameters_out_of_their_range_are_refused_by_name(name):
    for parameter, check in checks(get(name)).items():
        for value in bad_values(check):
            if value is None and "None" in get(name).__dataclass_fields__[parameter].type:
                continue
            with pytest.raises(
                (InvalidInputError, UnknownNameError), match=f"{parameter}.*(expected|Available|Did you mean)"
            ):
                made(name, scenario(usual(name)), **{parameter: value})


#: What depends on more than one number, by scenario: refused with the name of the first parameter and these words.
REFUSED = {
    "varga7-fast": [
        ("rhc_gradient", {"alpha_max": 1e-9}, "expected at least alpha_min = 1e-08, got 1e-09"),
        ("rhc", {"move_blocks": 30}, "expected at most horizon - 1 = 29, a knot at each step, got 30"),
        ("rhc", {"start_steps": 5, "starts": 3}, "expected 0 where restart_steps is 0, got 5"),
        ("qp", {"secondary_gain": 2000.0}, "expected a number below 2/Δt = 2000, got 2000"),
        ("qp", {"posture": [0.0, 1.0]}, r"expected shape \(7,\), got \(2,\)"),
        ("null_space", {"secondary_gain": 2000.0}, "expected a number below 2/Δt = 2000"),
        ("null_space", {"objective": "joint_centring"}, "expected an arm with joint limits, 'varga7' has none"),
        ("null_space", {"posture": (1.0, 2.0)}, r"expected shape \(7,\), got \(2,\)"),
        ("weighted_pseudoinverse", {"weights": 0.0}, "expected numbers above 0"),
        ("weighted_pseudoinverse", {"weights": (1.0, 2.0)}, r"expected shape \(7,\), got \(2,\)"),
        ("weighted_pseudoinverse", {"weights": "heavy"}, "expected an array of real numbers"),
        ("smoothed", {"relaxation": 2000.0}, "explicit Euler is stable below 2/Δt = 2000, got 2000"),
        ("smoothed", {"policy": "rhc_gradent"}, "Did you mean 'rhc_gradient'"),
        ("smoothed", {"policy": "follow_nominal"}, "expected one that acts on what it sees, got the reference"),
        ("smoothed", {"options": 5}, "expected the parameters of rhc_gradient by name, got 5"),
        ("predicted", {"delay": 13}, "expected a guess of at most longest_delay = 12 steps, got 13"),
        ("predicted", {"bandwidth": 5.0}, "expected a guess of at least lowest_bandwidth = 8 Hz, got 5"),
        ("full_orientation", {"policy": "smoothed"}, "got the policy that is made from others 'smoothed'"),
        ("mfac", {"rule": "sugihra"}, "Did you mean 'sugihara'"),
        ("mfac", {"growth": 2.0, "rule": "constant"}, "the damping rule 'constant' has only damping; got 2.0"),
        ("mfac", {"damping": -1.0}, "expected a finite number of at least 0"),
        ("mfac", {"growth": 0.5}, "expected a finite number of at least 1"),
        ("mfac", {"threshold": 0.0, "rule": "threshold"}, "expected a finite number above 0"),
        ("mfac", {"condition_bounds": (2, 1), "rule": "condition"}, "expected ascending numbers above 0"),
        ("mfac", {"dampings": (0, 1), "rule": "condition"}, "expected 1 x 4 numbers.* got 1 x 2"),
        ("mfac", {"dampings": (-1, 1), "rule": "condition"}, "expected rows of numbers of at least 0"),
        ("fixed_point", {"slope": 0.0}, "expected a number between -1 and 1 other than 0"),
        ("fixed_point", {"a": 0.0}, "expected a number other than 0"),
        ("follow_nominal", {"seed": "x"}, "expected a whole number of at least 0"),
    ],
    "varga7-random": [
        ("follow_nominal", {}, "a seed says which episode"),
        ("fixed_point_extended", {}, "a seed says which episode"),
    ],
    "zhang3-helix": [
        ("follow_nominal", {}, "'zhang3-helix' is given in Cartesian space"),
        ("smoothed", {}, "stable below 2/Δt = 2, got 300"),
    ],
    "faitli3-regular": [
        ("fixed_point", {"components": (0, 1, 2)}, "expected none with transformation 'transpose'"),
        ("fixed_point", {"components": (0, 1), "transformation": "none"}, "expected 3 different numbers below 3"),
        ("fixed_point", {"length": 1.0, "transformation": "none"}, "expected none but with transformation 'transpose'"),
        ("fixed_point_extended", {"link": 3}, "expected at most 2"),
        ("fixed_point_extended", {"transformation": "none"}, "a longer x needs the transposed Jacobian"),
        ("full_orientation", {}, "expected the task 'skew'"),
    ],
    "khan8-q1": [
        ("abstract_rotation", {"task_weights": 0.0}, "expected numbers above 0 and at most 1, got 0.0"),
        ("abstract_rotation", {"task_weights": (1.0,) * 8}, r"expected shape \(12,\), got \(8,\)"),
        ("abstract_rotation", {"joint_weights": (1.0,) * 7 + (1.5,)}, "expected numbers above 0 and at most 1"),
        ("fixed_point", {"transformation": "none"}, "needs as many components of the error as joints"),
    ],
    "zhang6-lspb": [
        ("pink", {"posture_rate": 1e4}, "expected at most 1"),
        ("pink", {"solver": "dapq"}, "Did you mean 'daqp'"),
        ("full_orientation", {}, "expected the task 'skew'"),
    ],
}


@pytest.mark.parametrize("on", REFUSED)
def test_what_does_not_suit_is_refused(on):
    for name, parameters, words in REFUSED[on]:
        parameter = next(iter(parameters), "")
        with pytest.raises((InvalidInputError, UnknownNameError), match=f"{parameter}.*{words}"):
            made(name, scenario(on), **parameters)


def test_plain_python_answers_as_the_compiled_kernels_do():
    """All compiled solvers of one step, two steps long; the receding horizons are tested beside their kernels."""
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
    monkeypatch.setattr(ikgym.kernels.compilation.announced.__wrapped__, "__defaults__", (0.01,))

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
