"""Policies under bad input: one clear error each, and none that costs a compilation."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
from baselines.registry import get
from ikgym.exceptions import IkgymError, InvalidInputError, UnknownNameError
from ikgym.frozen import check_instance, checks_of
from ikgym.plant.checks import joint_numbers
from ikgym.validation import number, whole_number
from tests.baselines.making import made, usual

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


def bad_values(check):
    """Values that the check of a parameter refuses, by what it says itself."""
    func = getattr(check, "func", check)
    if func in (number, whole_number):
        yield from ("x", np.nan, None, True)
        yield from (check.keywords[bound] for bound in ("above", "below") if bound in check.keywords)
        yield from (check.keywords["at_least"] - 1,) if "at_least" in check.keywords else ()
        yield from (check.keywords["at_most"] + 1,) if "at_most" in check.keywords else ()
        yield from (1.5,) if func is whole_number else (np.inf,)
    elif func is check_instance:
        yield from (1, [])
    elif func is joint_numbers:
        yield from ("x", np.nan, True, -1.0, [[1.0]])
    else:  # one of several words, or a truth value
        yield from ("nothing like it", 1, None)


@pytest.mark.parametrize("name", baselines.names())
def test_parameters_out_of_their_range_are_refused_by_name(name):
    checks = checks_of(get(name))
    for parameter in checks.keys() & get(name).parameter_names():
        check, optional = checks[parameter]
        for value in bad_values(check):
            if value is None and optional:
                continue
            with pytest.raises(
                (InvalidInputError, UnknownNameError), match=f"{parameter}.*(expected|Available|Did you mean)"
            ):
                made(name, usual(name), **{parameter: value})


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
    ],
    "zhang3-helix": [
        ("follow_nominal", {}, "'zhang3-helix' is given in Cartesian space"),
        ("smoothed", {}, "stable below 2/Δt = 2, got 300"),
        ("mfac", {"dampings": (), "condition_bounds": (), "rule": "condition"}, "expected 1 x 1 numbers, .* got 1 x 0"),
    ],
    "faitli3-regular": [
        ("fixed_point", {"components": (0, 1, 2)}, "expected none with transformation 'transpose'"),
        ("fixed_point", {"components": (0, 1), "transformation": "none"}, "expected 3 different numbers below 3"),
        ("fixed_point", {"length": 1.0, "transformation": "none"}, "expected none but with transformation 'transpose'"),
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
            made(name, on, **parameters)


@pytest.mark.parametrize(
    ("name", "on", "parameters", "message"),
    [
        ("rhc_gradent", "varga7-fast", {}, r"no policy 'rhc_gradent'\. Did you mean 'rhc_gradient'\?"),
        ("dls", "varga7-fast", {"dampng": 1.0}, r"no parameter 'dampng' of dls\. Did you mean 'damping'\?"),
        ("dls", "varga7-fast", {"problem": 1.0}, "no parameter 'problem' of dls"),
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
    with pytest.raises(
        InvalidInputError, match=r"state: expected the one that rhc_gradient.predict returned for a batch of 1"
    ):
        policy.predict(observation, state)


def test_a_state_of_another_batch_or_policy_is_refused(played):
    policy, observation, state = played
    batch = {key: np.stack([value] * 2) for key, value in observation.items()}
    with pytest.raises(
        InvalidInputError, match=r"state: expected the one that rhc_gradient.predict returned for a batch of 2"
    ):
        policy.predict(batch, state=state)
    with pytest.raises(InvalidInputError, match=r"state: expected the one that dls.predict returned"):
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
