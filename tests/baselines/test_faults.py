"""Policies under bad input: one clear error each, and none that costs a compilation."""

import numpy as np
import pytest

import baselines
import ikgym
from ikgym.exceptions import IkgymError, InvalidInputError

UNUSABLE = [
    [],
    {},
    {"a": 1},
    {1, 2},
    np.array([1.0, 2.0]),
    np.array(["dls", "rhc"]),
    [[1], [1, 2]],
    object(),
    None,
    b"x",
    "no such choice",
    np.nan,
    -1,
    5e-324,
    1e308,
    10**400,
    1 + 2j,
    len,
    range(3),
]


def refusal(name, parameter, value):
    """What is said of a value that is refused; nothing where it is taken."""
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


@pytest.fixture
def played():
    """A policy with a memory, an observation and the state after it."""
    policy = baselines.make("rhc_gradient", "varga7-fast")
    observation, _ = ikgym.RedundantIKEnv("varga7-fast").reset(seed=0)
    return policy, observation, policy.predict(observation)[1]


@pytest.mark.parametrize("dtype", [np.float32, np.int64, np.complex128, ">f8", object])
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
