"""The contract of all policies, over the registry."""

from __future__ import annotations

import copy
import dataclasses
import functools
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
from baselines.agents.policy import AgentAlone
from baselines.policy import Batch, Problem, Solution, SolverPolicy, statuses
from baselines.policy.compiled import CompiledPolicy
from baselines.registry import get
from baselines.status import Status
from baselines.wrapper import Wrapper
from ikgym import parallel
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.kernels.outcome import OBSERVED
from ikgym.plant import DrawnPlant
from ikgym.plant.draw import Draws
from ikgym.plant.rows import PlantRows
from ikgym.simulator import Simulator
from tests.baselines.making import made, usual
from tests.comparison import identical
from tests.every_scenario import ONE_OF_EACH

STEPS = 6


#: A task that no scenario of the catalogue has.
AXIS = ikgym.scenarios.get("zhang6-lspb").replace(name="zhang6-axis", task=ikgym.tasks.get("axis"))


@functools.cache
def scenario(name):
    return (AXIS if name == AXIS.name else ikgym.scenarios.get(name)).replace(steps=STEPS)


# Policies that are handed the nominal joint path: they need a seed on random scenarios, and suit no Cartesian one.
HANDED_THE_PATH = {"follow_nominal", "fixed_point_extended", "oracle"}

# Pairs that do not suit for another reason: the smoothing of 300 1/s is unstable at a sample time of 1 s; with 2 joints
# the tool is the end of link 2.
UNSUITED = {("smoothed", "zhang3-helix"), ("fixed_point_extended", "planar2-bent")}


@functools.cache
def policy_for(name, on):
    """The policy on a shortened scenario, or None where it does not suit; one for all tests, as policies are frozen."""
    seed = {"seed": 1} if name in HANDED_THE_PATH and scenario(on).random else {}
    try:
        return made(name, scenario(on), **seed)
    except InvalidInputError:
        if get(name).rival:
            assert on != usual(name)
            return None
        # An agent suits the arms of its size, and only skew coordinates have an ambiguity to resolve.
        suits = name != "full_orientation" or scenario(on).task.name == "skew"
        if suits and not (issubclass(get(name), AgentAlone) or (name, on) in UNSUITED):
            assert name in HANDED_THE_PATH
            assert scenario(on).nominal_joint_path(1) is None
        return None


PAIRS = [(name, on) for name in baselines.names() for on in [*ONE_OF_EACH, AXIS.name]]
contract = pytest.mark.parametrize(("name", "on"), PAIRS)

#: One scenario for each number of joints, task and kind of limits: all that the order in which rows are worked off can
#: depend on.
SHAPES = {
    *("varga7-fast", "planar2-bent", "zhang3-helix", "zhang6-lspb", "khan8-q7q8"),
    *("panda-circle", "tiago-raster", "iiwa14-random", AXIS.name),
}
by_rows = pytest.mark.parametrize(("name", "on"), [pair for pair in PAIRS if pair[1] in SHAPES])


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


@by_rows
def test_batch_equals_single_calls_and_memory_goes_by_rows(name, on):
    policy = policy_for(name, on)
    if policy is None:
        return
    rows = 3
    states, batched = [None] * rows, None
    for k, observation in enumerate(observations(on, policy.preview, rows)):
        # Row 1 begins a new episode at every other step, row 2 at the third.
        start = np.array([k == 0, k % 2 == 0, k in (0, 2)])
        action, batched = policy.predict(observation, state=batched, episode_start=start)
        assert action.dtype == np.float32
        for i in range(rows):
            single, states[i] = policy.predict(
                row(observation, i), state=None if start[i] else states[i], episode_start=np.array([False])
            )
            assert identical(single, action[i])
            assert all(identical(a[0], b[i]) for a, b in zip(states[i], batched, strict=True))


@by_rows
def test_rows_that_are_shared_out_to_threads_are_the_same(monkeypatch, name, on):
    policy = policy_for(name, on)
    if policy is None:
        return
    threads, solve = set(), type(policy).solve

    def watched(self, batch, memory):
        threads.add(threading.get_ident())
        return solve(self, batch, memory)

    monkeypatch.setattr(type(policy), "solve", watched)
    monkeypatch.setattr(parallel, "cores", lambda: 2)
    whole, shared = None, None
    for k, observation in enumerate(observations(on, policy.preview, 5)):
        start = np.array([k == 0, k == 2, False, False, k == 1])
        monkeypatch.setattr(type(policy), "grain", 100)
        expected, whole = policy.predict(observation, whole, start)
        monkeypatch.setattr(type(policy), "grain", 1)
        action, shared = policy.predict(observation, shared, start)
        assert identical(action, expected)
        assert identical(shared, whole)
    assert len(threads) > 1


# Solvers whose memory has no names yet.
UNNAMED = {
    *("moore_penrose", "dls", "jacobian_transpose", "weighted_pseudoinverse", "null_space", "truncated_svd"),
    *("gram_schmidt", "broyden", "abstract_rotation", "mfac", "mfapc"),
    *("rhc_gradient", "rhc_lagrange", "rhc", "rhc_foresight"),
}


@pytest.mark.parametrize("name", baselines.names())
def test_memory_is_a_named_tuple(name, monkeypatch):
    policy = made(name, scenario(usual(name)))
    own = policy.own_memory(1) if isinstance(policy, Wrapper) else policy.memory(1)
    assert name in UNNAMED or own == () or hasattr(own, "_fields")
    handed, solve = [], type(policy).solve

    def watched(self, batch, memory):
        handed.append(memory)
        return solve(self, batch, memory)

    monkeypatch.setattr(type(policy), "solve", watched)
    state = None
    for observation in observations(usual(name), policy.preview, 2):
        _, state = policy.predict(observation, state, np.array([False, True]))
        # The state is flat, and its memory has the names that `memory` gives it.
        assert type(state) is tuple
        assert type(policy.memory_of(state)) is type(policy.memory(1))
        assert identical(tuple(policy.memory_of(state)), state[2:])
    if isinstance(policy, CompiledPolicy):  # which calls its kernel with the memory's parts instead
        policy.solve(Batch(*[observation[key] for key in OBSERVED]), policy.memory_of(state))
    assert {type(memory) for memory in handed} == {type(policy.memory(1))}


@pytest.mark.parametrize("feedback", ["calculated", "measured"])
@pytest.mark.parametrize("name", [name for name in baselines.names() if not get(name).reference])
def test_any_policy_inside_smoothed(name, feedback):
    """At its first step, the inner policy sees what it would see alone; its state is found in the wrapper's."""
    short = scenario(usual(name))
    alone, policy = made(name, short), baselines.make("smoothed", short, policy=name, feedback=feedback)
    assert policy.preview == alone.preview
    assert policy.options == alone.parameters
    own, inside = policy.split(policy.memory(3))
    assert own._fields == ("known", "q", "qdot", "smooth")
    assert identical(tuple(inside), tuple(alone.memory(3)))
    state = None
    for k, observation in enumerate(observations(usual(name), policy.preview, 3)):
        action, state = policy.predict(observation, state)
        assert [array.shape for array in state[2:]] == [array.shape for array in (*own, *inside)]
        inner_state = policy.inner_state(state)
        assert identical(policy.report(state), alone.report(inner_state))
        assert identical(policy.diagnostics(state), alone.diagnostics(inner_state))
        if k == 0:
            np.testing.assert_array_equal(action, 0.0)
            if feedback == "measured":
                assert identical(inner_state, alone.predict(observation)[1])


#: Policies with a tolerance that something is tested against; all others cannot know whether they have converged.
TESTED = {
    "mfac",
    "mfapc",
    "fixed_point",
    "fixed_point_extended",
    "abstract_rotation",
    "rhc",
    "rhc_foresight",
    "rhc_gradient",
    "rhc_lagrange",
    "smoothed",  # around `rhc_gradient`
    *("offset_free", "calibrated"),  # around `rhc`
}


@pytest.mark.parametrize("name", sorted({*baselines.names()} - TESTED))
def test_only_those_with_a_tolerance_say_that_they_have_converged(name):
    """A formula was applied, on its path or meters away from it."""
    on = usual(name) if get(name).rival else "varga7-random"
    policy = policy_for(name, on)
    on_path = next(observations(on, policy.preview, 1))
    for observation in (on_path, {**on_path, "nominal": on_path["nominal"] + 1.0}):
        _, state = policy.predict(observation)
        assert policy.report(state).status[0] > Status.CONVERGED


@contract
def test_actions_are_in_the_box_and_deterministic_changes_nothing(name, on):
    policy = policy_for(name, on)
    if policy is None:
        return
    space = ikgym.RedundantIKEnv(scenario(on)).action_space
    state = None
    for observation in observations(on, policy.preview, 1):
        before = {key: value.copy() for key, value in observation.items()}
        kept = None if state is None else tuple(array.copy() for array in state)
        action, next_state = policy.predict(row(observation, 0), state=state, deterministic=True)
        again, same = policy.predict(row(observation, 0), state=state, deterministic=False)
        assert action in space
        assert identical(action, again)
        assert identical(next_state, same)
        assert identical(observation, before)
        assert state is None or identical(state, kept)
        report = policy.report(next_state)
        assert report.status[0] in set(Status)
        assert report.iterations[0] >= 0
        state = next_state


@contract
def test_a_policy_is_told_the_model_and_never_the_arm(name, on):
    policy = policy_for.__wrapped__(name, on)  # a new one: what it compiles when it is asked is a maze of numba's
    if policy is None or policy.reference:
        return
    assert {f.name for f in dataclasses.fields(Problem)} == {"model", "task", "cost", "dt", "velocity_limit"}
    assert policy.problem.model is scenario(on).model
    for thing in reachable(policy):
        assert not isinstance(thing, (ikgym.Scenario, gym.Env, gym.vector.VectorEnv, Simulator))
        assert not isinstance(thing, (ikgym.Plant, DrawnPlant, Draws, PlantRows))
        assert not isinstance(thing, ikgym.Arm) or thing is scenario(on).model


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


@pytest.mark.parametrize("name", [name for name in baselines.names() if not get(name).reference])
@pytest.mark.parametrize("on", ["khan8-q1", "khan8-q7q8"])
def test_the_exact_arm_changes_no_answer(name, on):
    """Same observations, same model, another arm behind the scenario: a policy that saw it would answer otherwise."""
    exact = scenario(on)
    if policy_for(name, on) is None:
        return
    mirrored = exact.replace(arm=exact.arm.replace(name="other", offsets=-2.0 * exact.arm.offsets), model=exact.model)
    policies = [baselines.make(name, which) for which in (exact, mirrored)]
    assert policies[0].problem.model is policies[1].problem.model is exact.model
    states = [None, None]
    for observation in observations(on, policies[0].preview, 2):
        answers = [p.predict(observation, state) for p, state in zip(policies, states, strict=True)]
        assert identical(*answers)
        states = [state for _, state in answers]


@pytest.mark.parametrize("name", [name for name in baselines.names() if not get(name).reference])
def test_the_true_plant_changes_no_answer(monkeypatch, name):
    """Same observations, same model, another plant behind the scenario, which nobody may ask for what it draws."""
    on = "iiwa14-random" if policy_for(name, "iiwa14-random") else usual(name)
    ideal = scenario(on)
    plant = ikgym.Plant(zero=0.1, link=0.1, axis=0.1, payload=0.1, bandwidth=(1, 9), command_delay=3, q_noise=0.1)

    def asked(*_):
        raise AssertionError(f"{name} asks for the true plant")

    monkeypatch.setattr(ikgym.Scenario, "drawn_plant", asked)
    monkeypatch.setattr(Draws, "__init__", asked)
    policies = [baselines.make(name, which) for which in (ideal, ideal.replace(plant=plant))]
    states = [None, None]
    for observation in observations(on, policies[0].preview, 2):
        answers = [p.predict(observation, state) for p, state in zip(policies, states, strict=True)]
        assert identical(*answers)
        states = [state for _, state in answers]


def test_the_guard_of_the_plant_would_notice():
    """A policy that keeps what it is told of the true plant is found out."""
    told = scenario("iiwa14-random").replace(plant=ikgym.Plant(zero=0.1))

    @dataclasses.dataclass(frozen=True, eq=False)
    class Told(get("dls")):
        plant: object = dataclasses.field(kw_only=True, default=None)

        @classmethod
        def for_scenario(cls, scenario, **parameters):
            return cls(Problem.of(scenario), plant=scenario.drawn_plant(1), **parameters)

    assert any(isinstance(thing, DrawnPlant) for thing in reachable(Told.for_scenario(told)))


@pytest.mark.parametrize("name", baselines.names())
def test_works_inside_evaluate_policy_with_several_environments(name):
    short = ikgym.scenarios.get(usual(name)).replace(steps=40)
    policy = made(name, short)

    def make():
        return Monitor(gym.make("RedundantIK-v0", scenario=short, preview=policy.preview))

    several, lengths = evaluate_policy(policy, DummyVecEnv([make] * 3), 6, return_episode_rewards=True)
    alone, _ = evaluate_policy(policy, make(), 1, return_episode_rewards=True)
    assert lengths == [40] * 6
    # A memory that were not cleared would show in the second episodes.
    assert set(several) == set(alone)


@pytest.mark.parametrize("name", baselines.names())
def test_policies_are_frozen_and_say_their_parameters(name):
    policy = made(name, usual(name))
    assert policy.name == name
    assert set(policy.parameters) == set(policy.parameter_names())
    for parameter in policy.parameters:
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(policy, parameter, 0)
    again = baselines.make(name, usual(name), **policy.parameters)
    assert again.parameters == policy.parameters


def test_unknown_names():
    with pytest.raises(UnknownNameError, match=r"no policy 'rhc_gradent'\. Did you mean 'rhc_gradient'\?"):
        baselines.make("rhc_gradent", "varga7-fast")
    with pytest.raises(UnknownNameError, match=r"no parameter of dls 'dampng'\. Did you mean 'damping'\?"):
        baselines.make("dls", "varga7-fast", dampng=1.0)
    with pytest.raises(UnknownNameError, match=r"no parameter of dls 'problem'"):
        baselines.make("dls", "varga7-fast", problem=1.0)
    with pytest.raises(UnknownNameError, match=r"no scenario 'varga7-fat'\. Did you mean 'varga7-fast'\?"):
        baselines.make("dls", "varga7-fat")


def test_too_short_a_preview_says_how_much():
    policy = baselines.make("rhc_gradient", "varga7-fast", horizon=6)
    observation, _ = gym.make("RedundantIK-v0", preview=2).reset()
    with pytest.raises(InvalidInputError, match=r"needs to be shown 5 steps ahead.* has 2.*preview=5"):
        policy.predict(observation)


def good(preview=2):
    return gym.make("RedundantIK-v0", preview=preview).reset()[0]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda o: o.pop("pose"), "expected a dict of number arrays with the keys"),
        (lambda o: o.update(q=np.zeros(6)), r"observation\['q'\]: expected shape \(7,\), got \(6,\)"),
        (lambda o: o.update(q=np.zeros((2, 7))), r"observation\['qdot'\]: expected shape \(2, 7\)"),
        (lambda o: o.update(nominal=np.zeros(6)), r"observation\['nominal'\]: expected shape"),
        (lambda o: o.update(nominal=np.zeros((2, 5))), r"observation\['nominal'\]: expected shape \(2, 6\)"),
        (lambda o: o.update(pose=np.full(6, np.nan)), "expected finite numbers"),
        (lambda o: o.update(nominal=np.full((2, 6), np.inf)), "expected finite numbers"),
        (lambda o: o.update(q=["a"] * 7), "expected a dict of number arrays"),
        (lambda o: o.update(q=np.array(["0.1"] * 7)), "expected a dict of number arrays"),
        (lambda o: o.update(q=np.full(7, 0.1 + 5j)), "expected a dict of number arrays"),
        (lambda o: o.update(remaining=np.array([np.nan])), "expected finite numbers"),
    ],
)
def test_bad_observations(spoil, message):
    observation = good()
    spoil(observation)
    with pytest.raises(InvalidInputError, match=message):
        baselines.make("rhc_gradient", "varga7-fast").predict(observation)


def test_no_observation_at_all():
    with pytest.raises(InvalidInputError, match="expected a dict"):
        baselines.make("dls", "varga7-fast").predict(np.zeros(7))


def test_a_state_of_another_batch_or_policy_is_refused():
    policy = baselines.make("rhc_gradient", "varga7-fast")
    _, state = policy.predict(good())
    batch = {key: np.stack([value] * 2) for key, value in good().items()}
    with pytest.raises(InvalidInputError, match=r"state: expected what rhc_gradient.predict returned for a batch of 2"):
        policy.predict(batch, state=state)
    with pytest.raises(InvalidInputError, match=r"state: expected what dls.predict returned"):
        baselines.make("dls", "varga7-fast").predict(good(), state=state)


@pytest.mark.parametrize("start", [[True, False], [[True]], "a", [None]])
@pytest.mark.parametrize("name", ["dls", "follow_nominal"])
def test_bad_episode_starts(name, start):
    policy = baselines.make(name, "varga7-fast")
    _, state = policy.predict(good())
    with pytest.raises(InvalidInputError, match="episode_start: expected 1 truth values"):
        policy.predict(good(), state, start)


@pytest.mark.parametrize("state", [3, "a", (None,) * 4, [np.zeros(1)] * 4, (np.zeros(1),) * 9])
def test_bad_states(state):
    with pytest.raises(InvalidInputError, match=r"state: expected what rhc_gradient.predict returned"):
        baselines.make("rhc_gradient", "varga7-fast").predict(good(), state)


def test_what_exceeds_the_velocity_limit_is_said():
    """The environment sees the action cut already, so that the policy has to say so."""
    scenario = ikgym.scenarios.get("varga7-fast").replace(velocity_limit=1e-3)
    batch = {key: np.stack([value] * 2) for key, value in good().items()}
    batch["nominal"][1] = batch["pose"][1]  # nothing to do in this row
    action, state = baselines.make("dls", scenario).predict(batch)
    assert baselines.SolverPolicy.report(state).status.tolist() == [Status.SATURATED, Status.APPLIED]
    assert abs(action[0]).max() == 1.0


@pytest.mark.parametrize("name", baselines.names())
def test_arrays_stay_read_only_in_copies(name):
    short = scenario(usual(name))
    for policy in (made(name, short), copy.deepcopy(made(name, short))):
        arrays = [policy.problem.velocity_limit, policy.problem.model.offsets]
        arrays += [value for value in vars(policy).values() if isinstance(value, np.ndarray)]
        assert not any(array.flags.writeable for array in arrays)
        (first, *_) = observations(usual(name), policy.preview, 1)
        assert policy.predict(row(first, 0))[0].shape == (policy.problem.model.joints,)


def test_long_compilation_of_a_policy_is_announced(monkeypatch, caplog):
    monkeypatch.setattr("baselines.policy.solver.compiled_classes", set())
    monkeypatch.setattr(ikgym.kernels.compilation.announced.__wrapped__, "__defaults__", (0.01,))

    class Slow(Broken):
        name = "slow"

        def solve(self, batch, memory):
            time.sleep(0.1)
            return Solution(np.zeros_like(batch.q), memory, statuses(1), np.zeros(1, dtype=np.int64))

    policy = Slow(Problem.of(scenario("varga7-fast")))
    policy.predict(good())
    assert caplog.text.count("Compiling the policy slow") == 1
    policy.predict(good())
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


class TestFollowNominal:
    def test_tracks_to_rounding_where_model_and_arm_agree(self):
        for on, seed in (("varga7-fast", None), ("varga7-random", 5)):
            short = ikgym.scenarios.get(on).replace(steps=50)
            policy = baselines.make("follow_nominal", short, seed=seed)
            env = gym.make("RedundantIK-v0", scenario=short, preview=1)
            observation, _ = env.reset(seed=seed)
            for _ in range(50):
                action, _ = policy.predict(observation)
                observation, *_, info = env.step(action)
                assert info["position_error"] < 1e-8  # what float32 actions leave

    def test_is_marked_and_needs_a_joint_path_and_a_seed(self):
        assert baselines.make("follow_nominal", "varga7-fast").reference
        assert not baselines.make("dls", "varga7-fast").reference
        with pytest.raises(InvalidInputError, match="'zhang3-helix' is given in Cartesian space"):
            baselines.make("follow_nominal", "zhang3-helix")
        with pytest.raises(InvalidInputError, match="a seed says which episode"):
            baselines.make("follow_nominal", "varga7-random")
        with pytest.raises(InvalidInputError, match="seed: expected a whole number"):
            baselines.make("follow_nominal", "varga7-random", seed="x")
