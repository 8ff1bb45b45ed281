"""Whatever actions, options and seeds are handed in: a valid step, or a clear error and the state as it was.

A small budget in the suite; `make fuzz` sets IKGYM_FUZZ to a number of examples a property.
"""

import os

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import ikgym
from ikgym.exceptions import IkgymError, InvalidInputError
from tests.comparison import identical

EXAMPLES = int(os.environ.get("IKGYM_FUZZ", "100"))
fuzz = settings(
    max_examples=EXAMPLES,
    derandomize="IKGYM_FUZZ" not in os.environ,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)

STEPS = 12
SCENARIO = ikgym.scenarios.get("varga7-random").replace(steps=STEPS, plant=ikgym.Plant(noise=0.1))
GOOD = np.full(7, 0.3, dtype=np.float32)

FLOATS = st.floats(allow_nan=True, allow_infinity=True, width=64)
ODD = st.one_of(
    st.none(),
    st.booleans(),
    FLOATS,
    st.text(max_size=5),
    st.lists(st.one_of(FLOATS, st.lists(FLOATS, max_size=2), st.text(max_size=2), st.none()), max_size=9),
    st.sampled_from([object(), {1, 2}, (), range(7), np.ma.masked, 10**400, [10**400] * 7, [1j] * 7]),
)
ARRAYS = st.one_of(
    hnp.arrays(np.float64, 7, elements=FLOATS),
    hnp.arrays(np.float64, 7, elements=st.floats(-2, 2)),
    hnp.arrays(
        st.sampled_from([np.float16, np.int8, np.bool_, np.complex128, "U3"]), st.sampled_from([(7,), (), (8,)])
    ),
)
ACTIONS = st.one_of(st.lists(FLOATS, min_size=7, max_size=7), ARRAYS, ODD)
OPTIONS = st.one_of(
    ODD,
    st.fixed_dictionaries({"q": st.one_of(ACTIONS, hnp.arrays(np.float64, 7, elements=st.floats(-6, 6)))}),
    st.dictionaries(st.sampled_from(["q", "Q", "reset_mask", ""]), ACTIONS, max_size=2),
)
SEEDS = st.one_of(st.none(), st.integers(0, 2**40), st.integers(), FLOATS, st.text(max_size=2), st.booleans())
# Refusals of ours, and that of Gymnasium for a seed.
REFUSED = (IkgymError, gym.error.Error)


@pytest.fixture(scope="module")
def envs():
    """Two, which a refused call must not distinguish."""
    return ikgym.RedundantIKEnv(SCENARIO), ikgym.RedundantIKEnv(SCENARIO)


def checked(env, returned):
    """A step as the specification has it."""
    observation, reward, terminated, truncated, info = returned
    assert env.observation_space.contains(observation)
    assert np.isfinite(reward)
    assert reward <= 0.0
    assert not terminated
    assert isinstance(truncated, bool)
    assert all(np.isfinite(value).all() for value in info.values())


def one_line(error):
    assert len(str(error).splitlines()) == 1
    assert len(str(error)) < 1000


@fuzz
@given(ACTIONS)
def test_any_action_is_a_step_or_an_error_that_changes_nothing(envs, action):
    env, twin = envs
    for each in envs:
        each.reset(seed=5)
    try:
        returned = env.step(action)
    except InvalidInputError as error:
        one_line(error)
    else:
        checked(env, returned)
        np.testing.assert_array_equal(np.shape(action), (7,))
        assert identical(returned, twin.step(np.asarray(action).astype(np.float64)))
    assert identical(env.step(GOOD), twin.step(GOOD))


@fuzz
@given(SEEDS, OPTIONS)
def test_any_reset_begins_an_episode_or_changes_nothing(envs, seed, options):
    env, twin = envs
    for each in envs:
        each.reset(seed=5)
        each.step(GOOD)
    try:
        observation, info = env.reset(seed=seed, options=options)
    except REFUSED as error:
        one_line(error)
    else:
        assert env.observation_space.contains(observation)
        assert info == {}
        assert isinstance(seed, (int, type(None)))
        assert identical(observation, twin.reset(seed=seed, options=options)[0])
    assert identical(env.step(GOOD), twin.step(GOOD))
