"""All forms of a policy: classes, instances, import paths, and objects with the `predict` of Stable-Baselines3."""

from __future__ import annotations

import pickle

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.evaluate import evaluate
from baselines.evaluation.metrics import TIME_COLUMNS
from baselines.evaluation.results import read_rows
from baselines.files import ResultsError
from baselines.solvers.resolved_rate.dls import DampedLeastSquares
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.evaluation.planning import planned

HELIX, STEPS = "zhang3-helix", 20


class Foreign:
    """Damped least squares with no more than a predict; notes what it is called with."""

    preview = 1

    def __init__(self, scenario=HELIX, **parameters):
        self.solver = baselines.make("dls", scenario, **parameters)
        self.calls = []

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        self.calls.append((state, episode_start.tolist(), deterministic))
        action, _ = self.solver.predict(observation)
        if len(self.calls) == 1:  # does not count, and leaves no trace
            observation["q"][:] = observation["nominal"][:] = 99.0
        return action, (0 if state is None else state) + 1


class OfScenario(Foreign):
    """Must be given the scenario."""

    def __init__(self, scenario, damping=1e-3):
        super().__init__(scenario, damping=damping)


class Bare:
    """States no preview."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        self.shape = observation["nominal"].shape
        return np.zeros_like(observation["q"], dtype=np.float32), None


def make_foreign():
    return Foreign()


def refuse(scenario):
    raise InvalidInputError("only for seven joints")


foreign = Foreign()
number = 3


def here(name):
    return f"{__name__}:{name}"


def numbers(row):
    """The columns that are equal for all forms of a policy."""
    others = {"policy", "parameters", "solver_status", "status_counts", "iterations", *TIME_COLUMNS}
    return {name: value for name, value in row.to_json().items() if name not in others}


@pytest.fixture(scope="module")
def solved():
    return evaluate(HELIX, "dls", steps=STEPS)[0]


# Solvers


def test_classes_instances_and_pairs_are_named_as_they_are_registered(solved):
    ways = [DampedLeastSquares, baselines.make("dls", HELIX), ("dls", {}), here("DampedLeastSquares")]
    for way in ways:
        (row,) = evaluate(HELIX, way, steps=STEPS)
        assert (row.policy, row.parameters, numbers(row)) == ("dls", solved.parameters, numbers(solved))
    assert len(evaluate(HELIX, ways, steps=STEPS)) == 1
    rows = evaluate(HELIX, [(DampedLeastSquares, {"damping": 0.1}), here("DampedLeastSquares:damping=0.2")], steps=3)
    assert [row.parameters["damping"] for row in rows] == [0.1, 0.2]


def test_a_class_that_is_not_registered_is_named_by_its_import_path():
    class Mine(DampedLeastSquares):
        pass

    (row,) = evaluate(HELIX, Mine, steps=3)
    assert row.policy == f"{__name__}:{Mine.__qualname__}"
    with pytest.raises(UnknownNameError, match=r"no parameter 'dampin' of .*Mine"):
        evaluate(HELIX, (Mine, {"dampin": 1}), steps=3)


def test_an_instance_plays_only_what_it_was_made_for():
    scenario = ikgym.scenarios.get(HELIX)
    others = scenario.replace(name="dt", dt=0.5), scenario.replace(name="cost", cost=ikgym.TrackingCost(p_x=2))
    rows = evaluate([scenario, *others], baselines.make("dls", scenario), steps=3)
    assert [row.scenario for row in rows] == [HELIX]
    reasons = [f"dls was made for a scenario with another {part}." for part in ("dt", "cost")]
    assert [(one.scenario, one.reason) for one in rows.skipped] == list(zip(("dt", "cost"), reasons, strict=True))
    with pytest.raises(InvalidInputError, match="Nothing to evaluate: dls in varga7-fast: dls was made for a scenario"):
        evaluate("varga7-fast", baselines.make("dls", scenario))
    rows = evaluate("varga7-random", [baselines.make("follow_nominal", "varga7-random", seed=3), "dls"], steps=3)
    assert [row.policy for row in rows] == ["dls"]
    assert "privileged information on one episode" in rows.skipped[0].reason


# Foreign policies


def test_an_object_with_a_predict_is_scored_as_a_solver_is(solved):
    model = Foreign()
    (row,) = evaluate(HELIX, model, steps=STEPS)
    assert numbers(row) == numbers(solved)
    assert (row.policy, row.parameters, row.solver_status, row.iterations) == ("Foreign", {}, "unknown", None)
    assert row.status_counts == {"unknown": STEPS}
    # One call that does not count, then one a step, with its memory, begun once.
    assert model.calls == [(None, [True], True), *((k or None, [k == 0], True) for k in range(STEPS))]


@pytest.mark.parametrize(
    ("policy", "name", "parameters"),
    [
        (here("Foreign:damping=1e-3"), "Foreign", {"damping": 1e-3}),
        ((here("OfScenario"), {"damping": 1e-3}), "OfScenario", {"damping": 1e-3}),
        (OfScenario, "OfScenario", {}),
        (here("foreign"), "foreign", {}),
        (here("make_foreign"), "make_foreign", {}),
    ],
)
def test_import_paths_classes_and_factories(solved, policy, name, parameters):
    (row,) = evaluate(HELIX, policy, steps=STEPS)
    assert (row.policy, row.parameters, row.solver_status) == (here(name), parameters, "unknown")
    assert numbers(row) == numbers(solved)


def test_objects_of_one_class_get_different_names():
    class dls(Foreign):  # noqa: N801  # takes the name of a registered policy
        pass

    one, other = Foreign(), Foreign(damping=0.1)
    rows = evaluate(HELIX, [one, other, one, dls(), "dls"], steps=STEPS)
    assert [row.policy for row in rows] == ["Foreign", "Foreign-2", "dls-2", "dls"]
    assert rows[0].total_cost != rows[1].total_cost


def test_previews():
    model = Bare()
    for stated, given, furthest, shape in (
        ((1, 4), None, 4, 2),
        (1, 7, 7, 7),
        (None, (2, 9), 9, 2),
        ([2, 5], None, 5, 2),
    ):
        model.preview = stated
        assert evaluate("varga7-fast", model, steps=3, preview=given)[0].preview == furthest
        assert model.shape == (shape, 6)
    for stated, message in (
        (None, "the number of steps ahead .* Give preview=…"),
        ((4, 1), "preview: expected a whole"),
    ):
        model.preview = stated
        with pytest.raises(InvalidInputError, match=f"'Bare': {message}"):
            evaluate("varga7-fast", model, steps=3)
    assert evaluate("varga7-fast", "rhc_gradient:iterations=1", steps=2, preview=(1, 2, 9))[0].preview == 9
    with pytest.raises(InvalidInputError, match=r"needs to be shown the steps \(1, 2\) ahead, got preview=\(1, 10\)"):
        evaluate("varga7-fast", "rhc_gradient", steps=2, preview=(1, 10))


class Failing(Bare):
    """Returns something else at its fourth call, the third that counts."""

    preview = 1

    def __init__(self, result):
        self.result, self.calls = result, 0

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        self.calls += 1
        return self.result() if self.calls == 4 else super().predict(observation)


@pytest.mark.parametrize(
    ("result", "message"),
    [
        (lambda: (np.array([0.0, np.nan, 0.0]), None), r"Failing in zhang3-helix, seed 0, step 3: expected finite"),
        (lambda: np.zeros(3), r"Failing: expected predict to return \(action, state\)"),
        (lambda: (None, None), "Failing: expected an action of numbers, got None"),
        (lambda: (np.zeros((1, 3)), None), r"action: expected shape \(3,\), got \(1, 3\)"),
        (lambda: {}["weights"], "Failing: predict raised KeyError: 'weights'"),
    ],
)
def test_invalid_actions_are_refused(result, message):
    with pytest.raises(InvalidInputError, match=message):
        evaluate(HELIX, Failing(result), steps=STEPS)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("number", "an object with a predict, or a class or function that makes one, got 3"),
        ("Foreign:dampin=1", "There is no parameter 'dampin' of dls"),
        ("refuse", "Nothing to evaluate: .*refuse in zhang3-helix: only for seven joints"),
    ],
)
def test_import_paths_of_something_else_are_refused(name, message):
    with pytest.raises((InvalidInputError, UnknownNameError), match=message):
        evaluate(HELIX, here(name), steps=3)


def test_policies_that_do_not_suit_a_scenario_are_skipped_with_the_reason():
    class Trained(Bare):
        preview = 2
        observation_space = ikgym.RedundantIKEnv("varga7-fast", preview=2).observation_space
        action_space = ikgym.RedundantIKEnv("varga7-fast", preview=2).action_space

    rows = evaluate(["varga7-fast", HELIX], [Trained(), "dls", "follow_nominal"], steps=3)
    suited = [("varga7-fast", policy) for policy in ("Trained", "dls", "follow_nominal")]
    assert [(row.scenario, row.policy) for row in rows] == [*suited, (HELIX, "dls")]
    assert [(one.scenario, one.policy) for one in rows.skipped] == [(HELIX, "Trained"), (HELIX, "follow_nominal")]
    assert "Trained has observations of the shape {" in rows.skipped[0].reason


# Wrapped environments


class Flat(Bare):
    """Plays on flat observations."""

    preview = 1

    def __init__(self, scenario=HELIX):
        self.solver, self.space = baselines.make("dls", scenario), ikgym.RedundantIKEnv(scenario, 1).observation_space

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        action, _ = self.solver.predict(gym.spaces.unflatten(self.space, observation))
        return action, None


def flattened(env):
    return gym.wrappers.TransformReward(gym.wrappers.FlattenObservation(env), lambda reward: 1e3 * reward)


def test_a_wrapped_environment_is_scored_below_its_wrappers(solved):
    rows = evaluate(HELIX, [Flat(), "dls"], steps=STEPS, wrap=flattened)
    assert [row.policy for row in rows] == ["Flat", "dls"]
    assert [numbers(row) for row in rows] == [numbers(solved)] * 2
    with pytest.raises(InvalidInputError, match="Flat: predict raised"):
        evaluate(HELIX, Flat(), steps=STEPS)
    scenario = ikgym.scenarios.get("panda-circle").replace(steps=STEPS, plant=ikgym.Plant(q_noise=1e-3))
    wraps = (None, gym.wrappers.OrderEnforcing)
    (plain,), (wrapped,) = (evaluate(scenario, Foreign(scenario), wrap=wrap) for wrap in wraps)
    assert plain.joint_limit_margin_min is not None
    assert numbers(wrapped) == numbers(plain)


def resetting(function):
    """A wrapper with another reset: `function(env, seed)`."""

    class Wrapper(gym.Wrapper):
        def reset(self, *, seed=None, options=None):
            return function(self.env, seed)

    return Wrapper


def step_at_reset(env, seed):
    env.reset(seed=seed)
    observation, *_, info = env.step(np.zeros(7, np.float32))
    return observation, info


class Twice(gym.Wrapper):
    """Makes two steps at a time."""

    def step(self, action):
        self.env.step(action)
        return self.env.step(action)


CHANGING = [
    resetting(lambda env, seed: env.reset()),
    resetting(lambda env, seed: env.reset(seed=seed, options={"step": 3})),
    resetting(step_at_reset),
    Twice,
]


def test_wrappers_that_change_the_episode_are_refused():
    for wrap, message in (
        (lambda env: 3, "wrap: expected the environment that it was given in wrappers, got 3"),
        (lambda env: gym.wrappers.TimeLimit(env, 5), "ended after 5 of 20 steps"),
        *((kind, "expected the episode of varga7-random with seed 2000000 from its start, got") for kind in CHANGING),
    ):
        with pytest.raises(InvalidInputError, match=message):
            evaluate("varga7-random", Foreign("varga7-random"), steps=STEPS, wrap=wrap)


def test_models_of_stable_baselines3():
    from stable_baselines3 import PPO

    env = gym.make("RedundantIK-v0", scenario=ikgym.scenarios.get(HELIX).replace(steps=STEPS), preview=2)
    options = {"n_steps": 8, "batch_size": 8, "device": "cpu", "seed": 0}
    plain = PPO("MultiInputPolicy", env, **options)
    flat = PPO("MlpPolicy", gym.wrappers.FlattenObservation(env), **options)
    (row,) = evaluate(HELIX, plain, steps=STEPS, preview=2)
    observation, _ = env.reset(seed=0)
    total = 0.0
    for _ in range(STEPS):
        observation, reward, _, _, _ = env.step(plain.predict(observation, deterministic=True)[0])
        total -= reward
    assert (row.policy, row.solver_status, row.total_cost) == ("PPO", "unknown", total)
    (wrapped,) = evaluate(HELIX, flat, steps=STEPS, preview=2, wrap=gym.wrappers.FlattenObservation)
    assert (wrapped.policy, wrapped.preview) == ("PPO", 2)
    with pytest.raises(InvalidInputError, match="PPO has observations of the shape"):
        evaluate(HELIX, flat, steps=STEPS, preview=2)


# Workers and folders


def test_objects_go_to_worker_processes_if_they_can_be_pickled():
    class Hidden(Foreign):
        pass

    with pytest.raises(InvalidInputError, match=r"Hidden cannot be sent to worker processes .*: use one worker"):
        evaluate(HELIX, [Hidden(), "dls"], steps=3, workers=2)
    assert len(evaluate(HELIX, Hidden(), steps=3, workers=2)) == 1  # one batch needs no worker
    job = pickle.loads(pickle.dumps(planned(HELIX, here("Foreign"), steps=3).jobs[0]))
    assert job.bind().name == here("Foreign")


def test_results_of_an_object_are_never_taken_for_those_of_another(tmp_path):
    options = {"steps": 3, "out": tmp_path}
    evaluate(HELIX, [Foreign(), here("Foreign")], **options)
    with pytest.raises(
        ResultsError, match="results of the object Foreign cannot be distinguished from those of another"
    ):
        evaluate(HELIX, Foreign(damping=0.1), resume=True, **options)
    there = read_rows(tmp_path / "results.json")
    assert [row.policy for row in there] == ["Foreign", here("Foreign")]
    assert evaluate(HELIX, here("Foreign"), resume=True, **options) == there[1:]
