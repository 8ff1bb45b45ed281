"""Whoever is evaluated: classes, instances, places, and whatever has the `predict` of Stable-Baselines3."""

from __future__ import annotations

import pickle

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.evaluate import evaluate
from baselines.evaluation.metrics import TIME_COLUMNS, Row
from baselines.evaluation.results import read_rows
from baselines.files import ResultsError
from baselines.solvers.resolved_rate.dls import DampedLeastSquares
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.evaluation.planning import planned

HELIX, STEPS = "zhang3-helix", 20


class Borrowed:
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


class Made(Borrowed):
    """Must be given the scenario."""

    def __init__(self, scenario, damping=1e-3):
        super().__init__(scenario, damping=damping)


class Bare:
    """Says nothing of what it is to be shown."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return np.zeros_like(observation["q"], dtype=np.float32), None


class Seeing(Bare):
    preview = (1, 4)

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        self.shape = observation["nominal"].shape
        return super().predict(observation)


def make_borrowed():
    return Borrowed()


def refuse(scenario):
    raise InvalidInputError("only for seven joints")


borrowed = Borrowed()
number = 3


def here(name):
    return f"{__name__}:{name}"


def numbers(row):
    """What does not depend on who is asked."""
    told = {"policy", "parameters", "solver_status", "status_counts", "iterations", *TIME_COLUMNS}
    return {name: value for name, value in row.to_json().items() if name not in told}


@pytest.fixture(scope="module")
def solved():
    return evaluate(HELIX, "dls", steps=STEPS)[0]


# Policies of our own kind


def test_classes_instances_and_pairs_are_named_as_they_are_registered(solved):
    ways = [DampedLeastSquares, baselines.make("dls", HELIX), ("dls", {}), here("DampedLeastSquares")]
    for way in ways:
        (row,) = evaluate(HELIX, way, steps=STEPS)
        assert (row.policy, row.parameters) == ("dls", solved.parameters)
        assert numbers(row) == numbers(solved)
    assert len(evaluate(HELIX, ways, steps=STEPS)) == 1
    rows = evaluate(HELIX, [(DampedLeastSquares, {"damping": 0.1}), here("DampedLeastSquares:damping=0.2")], steps=3)
    assert [row.parameters["damping"] for row in rows] == [0.1, 0.2]


def test_a_class_that_nobody_registered_is_named_by_its_place():
    class Mine(DampedLeastSquares):
        pass

    (row,) = evaluate(HELIX, Mine, steps=3)
    assert row.policy == f"{__name__}:{Mine.__qualname__}"
    with pytest.raises(UnknownNameError, match=r"no parameter of .*Mine 'dampin'"):
        evaluate(HELIX, (Mine, {"dampin": 1}), steps=3)


def test_an_instance_plays_only_what_it_was_made_for():
    scenario = ikgym.scenarios.get(HELIX)
    others = scenario.replace(name="dt", dt=0.5), scenario.replace(name="cost", cost=ikgym.TrackingCost(p_x=2))
    rows = evaluate([scenario, *others], baselines.make("dls", scenario), steps=3)
    assert [row.scenario for row in rows] == [HELIX]
    assert [(one.scenario, one.policy) for one in rows.skipped] == [("dt", "dls"), ("cost", "dls")]
    assert [one.reason for one in rows.skipped] == [
        f"dls was made for a scenario with another {what}." for what in ("dt", "cost")
    ]
    with pytest.raises(InvalidInputError, match="Nothing to evaluate: dls in varga7-fast: dls was made for a scenario"):
        evaluate("varga7-fast", baselines.make("dls", scenario))


def test_an_instance_that_knows_one_episode_does_not_play_others():
    handed = baselines.make("follow_nominal", "varga7-random", seed=3)
    rows = evaluate("varga7-random", [handed, "dls"], steps=3)
    assert [row.policy for row in rows] == ["dls"]
    assert "privileged information on one episode" in rows.skipped[0].reason


# Policies of others


def test_an_object_with_a_predict_is_scored_as_a_solver_is(solved):
    model = Borrowed()
    (row,) = evaluate(HELIX, model, steps=STEPS)
    assert numbers(row) == numbers(solved)
    assert (row.policy, row.parameters, row.solver_status) == ("Borrowed", {}, "unknown")
    assert row.status_counts == {"unknown": STEPS}
    assert row.iterations is None
    assert row.time_p50_us > 0
    assert Row(**Row.nan_restored(row.to_json())) == row
    # One call that does not count, then one a step, with its own memory, begun once.
    assert model.calls[0] == (None, [True], True)
    assert model.calls[1:] == [(k or None, [k == 0], True) for k in range(STEPS)]


@pytest.mark.parametrize(
    ("policy", "name", "parameters"),
    [
        (here("Borrowed:damping=1e-3"), "Borrowed", {"damping": 1e-3}),
        ((here("Made"), {"damping": 1e-3}), "Made", {"damping": 1e-3}),
        (Made, "Made", {}),
        (here("borrowed"), "borrowed", {}),
        (here("make_borrowed"), "make_borrowed", {}),
    ],
)
def test_places_classes_and_factories(solved, policy, name, parameters):
    (row,) = evaluate(HELIX, policy, steps=STEPS)
    assert (row.policy, row.parameters, row.solver_status) == (here(name), parameters, "unknown")
    assert numbers(row) == numbers(solved)


def test_objects_that_share_a_class_get_names_of_their_own():
    one, other = Borrowed(), Borrowed(damping=0.1)
    rows = evaluate(HELIX, [one, other, one], steps=STEPS)
    assert [row.policy for row in rows] == ["Borrowed", "Borrowed-2"]
    assert rows[0].total_cost != rows[1].total_cost

    class dls(Borrowed):  # noqa: N801  # takes the name of a registered policy
        pass

    assert [row.policy for row in evaluate(HELIX, [dls(), "dls"], steps=3)] == ["dls-2", "dls"]


def test_what_others_are_shown():
    model = Seeing()
    assert evaluate("varga7-fast", model, steps=3)[0].preview == 4
    assert model.shape == (2, 6)
    assert evaluate("varga7-fast", model, steps=3, preview=7)[0].preview == 7
    assert model.shape[0] == 7
    assert evaluate("varga7-fast", Bare(), steps=3, preview=(2, 9))[0].preview == 9
    with pytest.raises(InvalidInputError, match=r"'Bare': the number of steps ahead .* Give preview=…"):
        evaluate("varga7-fast", Bare(), steps=3)
    model.preview = [2, 5]
    assert evaluate("varga7-fast", model, steps=3)[0].preview == 5
    model.preview = (4, 1)
    with pytest.raises(InvalidInputError, match="'Seeing': preview: expected a whole number of at least 1, or rising"):
        evaluate("varga7-fast", model, steps=3)


def test_solvers_are_shown_nothing_that_they_would_misread():
    assert evaluate("varga7-fast", "rhc_gradient:iterations=1", steps=2, preview=(1, 2, 9))[0].preview == 9
    with pytest.raises(InvalidInputError, match=r"needs to be shown the steps \(1, 2\) ahead, got preview=\(1, 10\)"):
        evaluate("varga7-fast", "rhc_gradient", steps=2, preview=(1, 10))


class Answering(Bare):
    """Answers with something else at its fourth call, the third that counts."""

    preview = 1

    def __init__(self, answer):
        self.answer, self.made = answer, 0

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        self.made += 1
        return self.answer() if self.made == 4 else super().predict(observation)


def fail():
    raise KeyError("weights")


def test_answers_that_are_no_actions():
    for answer, message in (
        (lambda: (np.array([0.0, np.nan, 0.0]), None), r"Answering in zhang3-helix, seed 0, step 3: expected finite"),
        (lambda: np.zeros(3), r"Answering: expected predict to return \(action, state\)"),
        (lambda: (None, None), "Answering: expected an action of numbers, got None"),
        (lambda: (np.zeros((1, 3)), None), r"action: expected shape \(3,\), got \(1, 3\)"),
        (fail, "Answering: predict raised KeyError: 'weights'"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            evaluate(HELIX, Answering(answer), steps=STEPS)


def test_what_is_no_policy_is_refused():
    for policy, message in {
        "number": "an object with a predict, or a class or function that makes one, got 3",
        "Borrowed:dampin=1": "There is no parameter of dls 'dampin'",
        "refuse": "Nothing to evaluate: .*refuse in zhang3-helix: only for seven joints",
    }.items():
        with pytest.raises((InvalidInputError, UnknownNameError), match=message):
            evaluate(HELIX, here(policy), steps=3)


def test_what_does_not_suit_a_scenario_is_named_with_the_reason():
    class Trained(Bare):
        preview = 2
        observation_space = ikgym.RedundantIKEnv("varga7-fast", preview=2).observation_space
        action_space = ikgym.RedundantIKEnv("varga7-fast", preview=2).action_space

    rows = evaluate(["varga7-fast", HELIX], [Trained(), "dls", "follow_nominal"], steps=3)
    assert [(row.scenario, row.policy) for row in rows] == [
        ("varga7-fast", "Trained"),
        ("varga7-fast", "dls"),
        ("varga7-fast", "follow_nominal"),
        (HELIX, "dls"),
    ]
    assert [(one.scenario, one.policy) for one in rows.skipped] == [(HELIX, "Trained"), (HELIX, "follow_nominal")]
    assert "Trained has observations of the shape {" in rows.skipped[0].reason
    assert evaluate(HELIX, "dls", steps=3).skipped == ()


# Wrapped environments


class Flat(Bare):
    """Plays what FlattenObservation shows."""

    preview = 1

    def __init__(self, scenario=HELIX):
        self.solver, self.space = baselines.make("dls", scenario), ikgym.RedundantIKEnv(scenario, 1).observation_space

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        assert observation.ndim == 1
        action, _ = self.solver.predict(gym.spaces.unflatten(self.space, observation))
        return action, None


def flattened(env):
    return gym.wrappers.TransformReward(gym.wrappers.FlattenObservation(env), lambda reward: 1e3 * reward)


def test_a_wrapped_environment_is_scored_below_its_wrappers(solved):
    rows = evaluate(HELIX, [Flat(), "dls"], steps=STEPS, wrap=flattened)
    assert [row.policy for row in rows] == ["Flat", "dls"]
    for row in rows:
        assert numbers(row) == numbers(solved)
    with pytest.raises(InvalidInputError, match="Flat: predict raised"):
        evaluate(HELIX, Flat(), steps=STEPS)


def test_wrappers_change_no_number_of_an_imperfect_plant():
    scenario = ikgym.scenarios.get("panda-circle").replace(steps=STEPS, plant=ikgym.Plant(q_noise=1e-3))
    wraps = (None, gym.wrappers.OrderEnforcing)
    (plain,), (wrapped,) = (evaluate(scenario, Borrowed(scenario), wrap=wrap) for wrap in wraps)
    assert plain.joint_limit_margin_min is not None
    assert numbers(wrapped) == numbers(plain)


class NoSeed(gym.Wrapper):
    def reset(self, *, seed=None, options=None):
        return self.env.reset()


class Skipping(gym.Wrapper):
    def reset(self, *, seed=None, options=None):
        return self.env.reset(seed=seed, options={"step": 3})


class Elsewhere(gym.Wrapper):
    def reset(self, *, seed=None, options=None):
        return self.env.reset(seed=seed, options={"q": np.full(7, 0.1)})


class Warm(gym.Wrapper):
    def reset(self, *, seed=None, options=None):
        self.env.reset(seed=seed)
        observation, *_, info = self.env.step(np.zeros(7, np.float32))
        return observation, info


class Endless(gym.Wrapper):
    """Begins again where the episode ends, and says nothing."""

    def step(self, action):
        observation, reward, terminated, truncated, info = self.env.step(action)
        if truncated:
            observation, info = self.env.reset()
        return observation, reward, terminated, False, info


class Twice(gym.Wrapper):
    """Makes two steps at a time."""

    def step(self, action):
        self.env.step(action)
        return self.env.step(action)


CHANGING = (NoSeed, Warm, Elsewhere, Skipping, Twice)


def test_wrappers_that_change_the_episode_are_refused():
    for wrap, message in (
        (lambda env: 3, "wrap: expected the environment that it was given in wrappers, got 3"),
        (lambda env: gym.wrappers.TimeLimit(env, 5), "ended after 5 of 20 steps"),
        *(
            (kind, "expected the episode of varga7-random with seed 2000000 from its start, got another")
            for kind in CHANGING
        ),
    ):
        with pytest.raises(InvalidInputError, match=message):
            evaluate("varga7-random", Borrowed("varga7-random"), steps=STEPS, wrap=wrap)
    (whole,), (endless,) = (
        evaluate("varga7-random", Borrowed("varga7-random"), steps=STEPS, wrap=wrap) for wrap in (None, Endless)
    )
    assert numbers(endless) == numbers(whole)


# Models of Stable-Baselines3


def test_models_of_stable_baselines3():
    from stable_baselines3 import PPO

    env = gym.make("RedundantIK-v0", scenario=ikgym.scenarios.get(HELIX).replace(steps=STEPS), preview=2)
    options = {"n_steps": 8, "batch_size": 8, "device": "cpu", "seed": 0}
    plain = PPO("MultiInputPolicy", env, **options)
    flat = PPO("MlpPolicy", gym.wrappers.FlattenObservation(env), **options)
    (row,) = evaluate(HELIX, plain, steps=STEPS, preview=2)
    assert (row.policy, row.solver_status) == ("PPO", "unknown")
    observation, _ = env.reset(seed=0)
    total = 0.0
    for _ in range(STEPS):
        observation, reward, _, _, _ = env.step(plain.predict(observation, deterministic=True)[0])
        total -= reward
    assert row.total_cost == total
    wrapped = evaluate(HELIX, flat, steps=STEPS, preview=2, wrap=gym.wrappers.FlattenObservation)
    assert (wrapped[0].policy, wrapped[0].preview) == ("PPO", 2)
    with pytest.raises(InvalidInputError, match="PPO has observations of the shape"):
        evaluate(HELIX, flat, steps=STEPS, preview=2)
    with pytest.raises(InvalidInputError, match="'PPO': the number of steps ahead"):
        evaluate(HELIX, plain, steps=STEPS)


# Workers and folders


def test_others_go_to_worker_processes_if_they_can():
    class Hidden(Borrowed):
        pass

    with pytest.raises(InvalidInputError, match=r"Hidden cannot be sent to worker processes .*: use one worker"):
        evaluate(HELIX, [Hidden(), "dls"], steps=3, workers=2)
    assert len(evaluate(HELIX, Hidden(), steps=3, workers=2)) == 1  # one batch needs no worker
    job = pickle.loads(pickle.dumps(planned(HELIX, here("Borrowed"), steps=3).jobs[0]))
    assert job.bind().name == here("Borrowed")


def test_results_of_an_object_are_never_taken_for_those_of_another(tmp_path):
    options = {"steps": 3, "out": tmp_path}
    evaluate(HELIX, [Borrowed(), here("Borrowed")], **options)
    with pytest.raises(
        ResultsError, match="results of the object Borrowed cannot be distinguished from those of another"
    ):
        evaluate(HELIX, Borrowed(damping=0.1), resume=True, **options)
    assert [row.policy for row in read_rows(tmp_path / "results.json")] == ["Borrowed", here("Borrowed")]
    (row,) = evaluate(HELIX, here("Borrowed"), resume=True, **options)
    assert row == read_rows(tmp_path / "results.json")[1]
