"""The bank of Kalman filters: probabilities of noises, changes of joint zeros, and the mixed estimate."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
from baselines.solvers.adaptive.chain_parameters import parameter_twists
from ikgym.exceptions import InvalidInputError
from tests.baselines.solvers.adaptive.arms import PANDA, noisy, observed, path, perturbed, scenario
from tests.baselines.solvers.adaptive.test_corrected import deviation_of, true_deviation
from tests.comparison import identical


def learnt(policy, arm, zeros, q, noise=0.0, state=None, start=None, changed=(0.0, 10**9)):
    """The state after some postures, with a change of the joint zeros from one of them on."""
    on, rng = scenario(), np.random.default_rng(1)
    change, at = changed
    for k, posture in enumerate(q):
        seen = observed(on, arm, zeros + np.asarray(change) * (k >= at), posture)
        _, state = policy.predict(noisy(on, seen, rng, noise) if noise else seen, state, start)
        start = None
    return state


def memory(policy, state):
    return policy.split(policy.memory_of(state))[0]


def test_one_filter_without_changes_is_the_filter_of_calibrated():
    (arm, zeros), q = perturbed(1), path(2, 20)
    one = baselines.make("filter_bank", scenario(), policy="dls", noises=(3e-4,), rate=0.0, start=1e-4)
    noise = {"pose_noise": 3e-4, "pose_rotation_noise": 3e-4}
    other = baselines.make("calibrated", scenario(), policy="dls", jump=0.0, start=1e-4, **noise)
    ours, theirs = (memory(policy, learnt(policy, arm, zeros, q)) for policy in (one, other))
    np.testing.assert_allclose(ours.estimates[0], theirs.parameters, atol=1e-10)
    np.testing.assert_allclose(ours.covariances[0], theirs.covariance, atol=1e-15)


def test_probabilities_are_those_of_bayes():
    """Of all measurements at once, whose covariance is that of the prior seen through their derivatives, and noise."""
    (arm, zeros), q, noises = perturbed(1, size=1e-6), path(2, 4), (2e-6, 2.2e-6, 2.6e-6)
    prior = {"zero": 2e-6, "link": 1e-6, "axis": 3e-6}
    policy = baselines.make("filter_bank", scenario(), policy="dls", noises=noises, rate=0.0, **prior)
    twist, rows = np.zeros((6, 45)), []
    for posture in q:
        parameter_twists(PANDA.chain, posture, PANDA.forward(posture)[1], twist)
        rows.append(twist.copy())
    sensitivity = np.concatenate(rows)
    error = np.concatenate([true_deviation(arm, zeros, posture) for posture in q])
    spread = sensitivity * np.repeat([2e-6, 1e-6, 3e-6], [7, 24, 14]) ** 2 @ sensitivity.T
    totals = [spread + noise**2 * np.eye(len(error)) for noise in noises]
    logs = [-0.5 * (np.linalg.slogdet(t)[1] + error @ np.linalg.solve(t, error)) for t in totals]
    expected = np.exp(np.array(logs) - max(logs))
    found = np.exp(memory(policy, learnt(policy, arm, zeros, q)).weights[0])
    assert expected.min() > 1e-4
    np.testing.assert_allclose(found, expected / expected.sum(), rtol=2e-3)


@pytest.mark.parametrize("noise", [0.0, 2e-4, 1e-3])
def test_the_noise_is_found(noise):
    policy = baselines.make("filter_bank", scenario(), policy="dls")
    weights = memory(policy, learnt(policy, *perturbed(3), path(4, 60), noise)).weights[0]
    assert policy.noises[int(weights.argmax())] == (noise or 1e-5)
    assert np.exp(weights).sum() == pytest.approx(1.0)


ALIKE, EACH = np.full(7, 1e-3), 1e-3 * np.array([1.0, -2.0, 1.5, 0.5, -1.0, 2.0, -1.0])


@pytest.mark.parametrize("change", [ALIKE, EACH], ids=["alike", "each"])
def test_a_change_is_noticed(change):
    """What was learnt for long is given up within some measurements, if joint zeros may change."""
    (arm, zeros), q, left = perturbed(8), path(9, 240), {}
    for rate in (0.0, 0.2):
        policy = baselines.make("filter_bank", scenario(), policy="dls", rate=rate)
        state = learnt(policy, arm, zeros, q, 3e-4, changed=(change, 220))
        missing = deviation_of(policy, state, q[-1]) - true_deviation(arm, zeros + change, q[-1])
        left[rate] = np.abs(missing).max()
    assert left[0.2] < 4e-4 < left[0.0]


@pytest.mark.parametrize("keep", [True, False])
def test_what_is_kept_survives_the_start_of_an_episode(keep):
    (arm, zeros), q = perturbed(6), path(7, 30)
    policy = baselines.make("filter_bank", scenario(), policy="dls", keep=keep)
    begun = learnt(policy, arm, zeros, q[:1], state=learnt(policy, arm, zeros, q), start=np.array([True]))
    once = learnt(policy, arm, zeros, q[:1])
    assert identical(memory(policy, begun).before, memory(policy, once).before)
    assert identical(memory(policy, begun).estimates, memory(policy, once).estimates) != keep


@pytest.mark.parametrize("noises", [(), (1e-3, 0.0), (np.nan,)])
def test_bad_noises(noises):
    with pytest.raises(InvalidInputError, match="noises"):
        baselines.make("filter_bank", scenario(), noises=noises)
