"""Policies under bad input: one clear error each, and none that costs a compilation."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
from ikgym.exceptions import IkgymError, InvalidInputError, UnknownNameError

UNUSABLE = [
    *([], {}, {"a": 1}, {1, 2}, np.array([1.0, 2.0]), np.array(["dls", "rhc"]), [[1], [1, 2]], object(), None, b"x"),
    *("no such choice", np.nan, -1, 5e-324, 1e308, 10**400, 1 + 2j, len, range(3)),
]


def refusal(name, parameter, value):
    """The message about a value that is refused; nothing where it is taken."""
    try:
        baselines.make(name, "varga7-fast", **{parameter: value})
    except IkgymError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", [*baselines.names(), "agent"])
def test_parameters_of_any_type_are_taken_or_refused_in_one_line(name):
    for parameter in baselines.get(name).parameter_names():
        for value in UNUSABLE:
            message = refusal(name, parameter, value)
            assert len(message.splitlines()) <= 1, (parameter, value)


@pytest.mark.parametrize(
    ("name", "on", "parameters", "message"),
    [
        ("rhc_gradent", "varga7-fast", {}, r"no policy 'rhc_gradent'\. Did you mean 'rhc_gradient'\?"),
        ("dls", "varga7-fast", {"dampng": 1.0}, r"no parameter of dls 'dampng'\. Did you mean 'damping'\?"),
        ("dls", "varga7-fast", {"problem": 1.0}, "no parameter of dls 'problem'"),
        ("dls", "varga7-fat", {}, r"no scenario 'varga7-fat'\. Did you mean 'varga7-fast'\?"),
    ],
)
def test_unknown_names(name, on, parameters, message):
    with pytest.raises(UnknownNameError, match=message):
        baselines.make(name, on, **parameters)


@pytest.fixture
def played():
    """A policy with a memory, an observation and the state after it."""
    policy = baselines.make("rhc_gradient", "varga7-fast")
    observation, _ = gym.make("RedundantIK-v0", preview=2).reset(seed=0)
    return policy, observation, policy.predict(observation)[1]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"pose": None}, "expected a dict of number arrays with the keys"),
        ({"q": np.zeros(6)}, r"observation\['q'\]: expected shape \(7,\), got \(6,\)"),
        ({"q": np.zeros((2, 7))}, r"observation\['qdot'\]: expected shape \(2, 7\)"),
        ({"nominal": np.zeros(6)}, r"observation\['nominal'\]: expected shape"),
        ({"nominal": np.zeros((2, 5))}, r"observation\['nominal'\]: expected shape \(2, 6\)"),
        ({"nominal": np.zeros((1, 6))}, r"needs to be shown 2 steps ahead.* has 1.*preview=2"),
        ({"q": ["a"] * 7}, "expected a dict of number arrays"),
        ({"q": np.array(["0.1"] * 7)}, "expected a dict of number arrays"),
        ({"q": np.full(7, 0.1 + 5j)}, "expected a dict of number arrays"),
        (None, "expected a dict of number arrays"),
    ],
)
def test_bad_observations(played, changes, message):
    policy, observation, _ = played
    given = np.zeros(7) if changes is None else {k: v for k, v in (observation | changes).items() if v is not None}
    with pytest.raises(InvalidInputError, match=message):
        policy.predict(given)


@pytest.mark.parametrize("start", [[True, False], [[True], [True, False]], "a", [None], {True}])
def test_bad_episode_starts(played, start):
    policy, observation, state = played
    with pytest.raises(InvalidInputError, match="episode_start: expected 1 truth values"):
        policy.predict(observation, state, start)


@pytest.mark.parametrize("state", [3, "a", (), {}, (None,) * 4, [np.zeros(1)] * 4, (np.zeros(1),) * 9])
def test_bad_states(played, state):
    policy, observation, _ = played
    with pytest.raises(InvalidInputError, match=r"state: expected what rhc_gradient.predict returned for a batch of 1"):
        policy.predict(observation, state)


def test_a_state_of_another_batch_or_policy_is_refused(played):
    policy, observation, state = played
    batch = {key: np.stack([value] * 2) for key, value in observation.items()}
    with pytest.raises(InvalidInputError, match=r"state: expected what rhc_gradient.predict returned for a batch of 2"):
        policy.predict(batch, state=state)
    with pytest.raises(InvalidInputError, match=r"state: expected what dls.predict returned"):
        baselines.make("dls", "varga7-fast").predict(observation, state=state)


@pytest.mark.parametrize("dtype", [np.float32, np.complex128, ">f8", object])
def test_a_state_of_another_type_is_refused(played, dtype):
    policy, observation, state = played
    wrong = (*state[:2], *(array.astype(dtype) for array in state[2:]))
    given = np.dtype(dtype)
    message = rf"state: expected arrays of \['float64', 'float64'\] behind .*, got \['{given}', '{given}'\]"
    with pytest.raises(InvalidInputError, match=message):
        policy.predict(observation, wrong)


def test_states_and_observations_that_cannot_be_written_to_compile_nothing(played):
    from baselines.solvers.receding_horizon.gradient import descend_rows

    policy, observation, state = played
    wanted, _ = policy.predict(observation, state)
    before = len(descend_rows.signatures)
    for array in (*state, *observation.values()):
        array.flags.writeable = False
    got, _ = policy.predict(observation, state)
    np.testing.assert_array_equal(got, wanted)
    strided = tuple(np.repeat(array, 2, axis=-1)[..., ::2] if array.ndim > 1 else array for array in state)
    np.testing.assert_array_equal(policy.predict(observation, strided)[0], wanted)
    assert len(descend_rows.signatures) == before
