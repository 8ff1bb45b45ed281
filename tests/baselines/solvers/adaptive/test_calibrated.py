"""The extended Kalman filter of an arm's kinematics."""

import numpy as np
import pytest

import baselines
from baselines.solvers.adaptive.calibrated import PAUSE
from baselines.solvers.adaptive.chain_parameters import parameter_twists
from tests.baselines.solvers.adaptive.arms import PANDA, noisy, observed, path, perturbed, scenario
from tests.baselines.solvers.adaptive.test_corrected import deviation_of, true_deviation
from tests.comparison import identical

NOISE = {"pose_noise": 1e-5, "pose_rotation_noise": 2e-5}


def learnt(policy, arm, zeros, q, state=None, start=None):
    on = scenario()
    for posture in q:
        _, state = policy.predict(observed(on, arm, zeros, posture), state, start)
        start = None
    return state


def parameters(policy, state):
    return policy.split(policy.memory_of(state))[0].parameters[0]


def test_it_is_the_least_squares_solution_with_the_prior():
    """For errors that are so small that the pose is linear in them."""
    (arm, zeros), q = perturbed(1, size=1e-6), path(2, 12)
    prior = {"zero": 2e-6, "link": 1e-6, "axis": 3e-6}
    noise = {"pose_noise": 1e-7, "pose_rotation_noise": 2e-7}
    policy = baselines.make("calibrated", scenario(), policy="dls", **prior, **noise, jump=0.0)
    found = parameters(policy, learnt(policy, arm, zeros, q))
    weights = 1.0 / np.repeat([2e-6, 1e-6, 3e-6], [7, 24, 14]) ** 2
    normal, rhs, twist = np.diag(weights), np.zeros(45), np.zeros((6, 45))
    precision = 1.0 / np.repeat([1e-7, 2e-7], 3) ** 2
    for posture in q:
        parameter_twists(PANDA.chain, posture, PANDA.forward(posture)[1], twist)
        normal += twist.T * precision @ twist
        rhs += twist.T * precision @ true_deviation(arm, zeros, posture)
    expected = np.linalg.solve(normal, rhs)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def test_postures_that_were_not_seen_are_predicted():
    """A deviation that is filtered knows nothing of other postures; calibrated kinematics do."""
    (arm, zeros), on = perturbed(3), scenario()
    q, elsewhere = path(4, 200), path(5, 200)[-1]
    missing = {}
    for name, options in (("calibrated", NOISE), ("offset_free", {"gain": 1.0})):
        policy = baselines.make(name, on, policy="dls", **options)
        state = learnt(policy, arm, zeros, q)
        missing[name] = np.abs(deviation_of(policy, state, elsewhere) - true_deviation(arm, zeros, elsewhere)).max()
    assert missing["calibrated"] < 0.2 * missing["offset_free"]


def test_a_start_on_the_reference_is_the_best_measurement():
    """The first pose is blurred, and where the arm begins is known: only the latter says where it is."""
    (arm, zeros), on = perturbed(3), scenario()
    q = path(4, 2)[0]
    reference = on.task.coordinates(*arm.forward(q + zeros))
    blurred = reference.copy()
    blurred[-3:] += 3e-4
    missing = []
    for start in (None, 1e-6):
        policy = baselines.make("calibrated", on, policy="dls", start=start)
        seen = {**observed(on, arm, zeros, q, reference), "pose": blurred}
        _, state = policy.predict(seen)
        missing.append(np.abs(deviation_of(policy, state, q) - true_deviation(arm, zeros, q)).max())
    assert missing[1] < 1e-5 < 1e-4 < missing[0]


@pytest.mark.parametrize("keep", [True, False])
def test_what_is_kept_survives_the_start_of_an_episode_and_no_more(keep):
    (arm, zeros), q = perturbed(6), path(7, 30)
    policy = baselines.make("calibrated", scenario(), policy="dls", keep=keep, **NOISE)
    state = learnt(policy, arm, zeros, q)
    once = learnt(policy, arm, zeros, q[:1], None)
    begun = learnt(policy, arm, zeros, q[:1], state, np.array([True]))
    own, first = (policy.split(policy.memory_of(s))[0] for s in (begun, once))
    assert identical(own.before, first.before)
    assert identical(own.parameters, first.parameters) != keep
    assert np.trace(own.covariance[0]) < np.trace(first.covariance[0]) or not keep
    assert identical(learnt(policy, arm, zeros, q[:1], None)[2:], once[2:])


def test_what_is_kept_is_kept_inside_other_policies():
    (arm, zeros), q = perturbed(6), path(7, 30)
    inner = {"policy": "dls", "keep": True, **NOISE}
    policy = baselines.make("smoothed", scenario(), policy="calibrated", options=inner, feedback="measured")
    state = learnt(policy, arm, zeros, q)
    begun = learnt(policy, arm, zeros, q[:1], state, np.array([True]))
    before, after = (parameters(policy.inner, policy.inner_state(s)) for s in (state, begun))
    assert np.abs(before).max() > 1e-4
    assert np.abs(after - before).max() < 0.1 * np.abs(before).max()


def test_a_lost_action_clears_what_is_kept():
    policy = baselines.make("calibrated", scenario(), policy="dls", keep=True)
    state = learnt(policy, *perturbed(6), path(7, 3))
    memory = policy.memory_of(state)
    cleared = policy._without_lost(memory, np.full((1, 7), np.nan))
    assert identical(tuple(cleared), tuple(policy.memory(1)))


def test_noise_alone_is_no_change_of_the_arm():
    """Of what a camera measures as it was said, nothing is a surprise; nor where the noise is a fifth larger."""
    (arm, zeros), on = perturbed(8), scenario()
    for noise in (5e-4, 6e-4):
        policy, state, rng = (
            baselines.make("calibrated", on, policy="dls", pose_noise=5e-4),
            None,
            np.random.default_rng(2),
        )
        for posture in path(9, 300):
            _, state = policy.predict(noisy(on, observed(on, arm, zeros, posture), rng, noise), state)
        assert policy.split(policy.memory_of(state))[0].quiet[0] == 300 + PAUSE


@pytest.mark.parametrize(("jump", "within"), [(1e-3, True), (0.0, False)])
def test_a_payload_is_noticed(jump, within):
    """What was learnt for long is given up at once, if joint zeros may change suddenly."""
    (arm, zeros), q, on, rng = perturbed(8), path(9, 240), scenario(), np.random.default_rng(1)
    policy, state = baselines.make("calibrated", on, policy="dls", jump=jump), None
    for k, posture in enumerate(q):
        loaded = zeros + (1e-3 if k >= 220 else 0.0)
        _, state = policy.predict(noisy(on, observed(on, arm, loaded, posture), rng, 3e-4), state)
    left = np.abs(deviation_of(policy, state, q[-1]) - true_deviation(arm, loaded, q[-1])).max()
    assert (left < 5e-4) == within
