"""Wrappers that correct a model: the filters in formulas, what they show to the base policy, and its tracking."""

import functools

import numpy as np
import pytest

import baselines
import ikgym
from baselines.policy import Problem
from baselines.solvers.adaptive.chain_parameters import parameter_twists
from baselines.solvers.adaptive.filter_bank import PAUSE
from ikgym import Plant
from ikgym.exceptions import InvalidInputError
from tests.baselines.solvers.adaptive.arms import (
    PANDA,
    deviation_of,
    learnt,
    memory,
    observed,
    path,
    perturbed,
    scenario,
    true_deviation,
)
from tests.baselines.test_wrapper import Halved
from tests.comparison import identical

NAMES = ["offset_free", "calibrated", "filter_bank"]
EXACT = {"pose_noise": 1e-6, "pose_rotation_noise": 1e-6}
SETTLED = {"offset_free": {"gain": 1.0}, "calibrated": EXACT, "filter_bank": {"noises": (1e-6,)}}
NOISE = {"pose_noise": 1e-5, "pose_rotation_noise": 2e-5}
#: A prior, its variances, and an arm so near its model that the pose is linear in the parameters.
PRIOR = {"zero": 2e-6, "link": 1e-6, "axis": 3e-6}
VARIANCES = np.repeat([2e-6, 1e-6, 3e-6], [7, 24, 14]) ** 2
LINEAR = perturbed(1, size=1e-6)


def made(name, **parameters):
    return baselines.make(name, scenario(), policy="dls", **parameters)


def sensitivities(q):
    """Derivatives of the poses by the parameters. Shape (len(q), 6, 45)."""
    out = np.zeros((len(q), 6, 45))
    for posture, twist in zip(q, out, strict=True):
        parameter_twists(PANDA.chain, posture, PANDA.forward(posture)[1], twist)
    return out


def test_calibrated_is_the_least_squares_solution_with_the_prior():
    q = path(2, 12)
    policy = made("calibrated", **PRIOR, pose_noise=1e-7, pose_rotation_noise=2e-7, jump=0.0)
    normal, rhs = np.diag(1.0 / VARIANCES), np.zeros(45)
    precision = 1.0 / np.repeat([1e-7, 2e-7], 3) ** 2
    for posture, twist in zip(q, sensitivities(q), strict=True):
        normal += twist.T * precision @ twist
        rhs += twist.T * precision @ true_deviation(*LINEAR, posture)
    expected = np.linalg.solve(normal, rhs)
    found = memory(policy, learnt(policy, *LINEAR, q)).estimates[0, 0]
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def test_probabilities_of_a_bank_are_those_of_bayes():
    """Of all measurements at once, whose covariance is that of the prior seen through their derivatives, and noise."""
    q, noises = path(2, 4), (2e-6, 2.2e-6, 2.6e-6)
    policy = made("filter_bank", noises=noises, rate=0.0, **PRIOR)
    sensitivity = np.concatenate(sensitivities(q))
    error = np.concatenate([true_deviation(*LINEAR, posture) for posture in q])
    spread = sensitivity * VARIANCES @ sensitivity.T
    totals = [spread + noise**2 * np.eye(len(error)) for noise in noises]
    logs = [-0.5 * (np.linalg.slogdet(t)[1] + error @ np.linalg.solve(t, error)) for t in totals]
    expected = np.exp(np.array(logs) - max(logs))
    found = np.exp(memory(policy, learnt(policy, *LINEAR, q)).weights[0])
    assert expected.min() > 1e-4
    np.testing.assert_allclose(found, expected / expected.sum(), rtol=2e-3)


@pytest.mark.parametrize("noise", [0.0, 2e-4, 1e-3])
def test_a_bank_finds_the_noise(noise):
    policy = made("filter_bank")
    weights = memory(policy, learnt(policy, *perturbed(3), path(4, 60), noise)).weights[0]
    assert policy.noises[int(weights.argmax())] == (noise or 1e-5)
    assert np.exp(weights).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("noises", [(), (1e-3, 0.0), (np.nan,)])
def test_bad_noises(noises):
    with pytest.raises(InvalidInputError, match="noises"):
        made("filter_bank", noises=noises)


def test_a_start_on_the_reference_is_the_best_measurement():
    """The first pose is blurred, and where the arm begins is known: only the latter says where it is."""
    (arm, zeros), on, q = perturbed(3), scenario(), path(4, 2)[0]
    seen = observed(on, arm, zeros, q)
    blurred = seen | {"pose": seen["pose"] + 3e-4 * np.repeat([0.0, 1.0], [9, 3])}
    missing = []
    for start in (None, 1e-6):
        policy = made("calibrated", start=start)
        _, state = policy.predict(blurred)
        missing.append(np.abs(deviation_of(policy, state, q) - true_deviation(arm, zeros, q)).max())
    assert missing[1] < 1e-5 < 1e-4 < missing[0]


@pytest.mark.parametrize("name", ["calibrated", "filter_bank"])
def test_what_is_kept_survives_the_start_of_an_episode_and_no_more(name):
    arm, q = perturbed(6), path(7, 30)
    for keep in (True, False):
        policy = made(name, keep=keep)
        once = memory(policy, learnt(policy, *arm, q[:1]))
        state = learnt(policy, *arm, q)
        begun = memory(policy, learnt(policy, *arm, q[:1], state=state, start=np.array([True])))
        assert identical(begun.before, once.before)
        assert identical(begun[4:6], once[4:6]) != keep
        # A lost action clears it.
        cleared = policy._without_lost(policy.memory_of(state), np.full((1, 7), np.nan))
        assert identical(tuple(cleared), tuple(policy.memory(1)))


class Outer(Halved):
    """A wrapper around wrappers."""

    nests = True


def test_what_is_kept_is_kept_inside_other_policies():
    arm, q = perturbed(6), path(7, 30)
    inner = {"policy": "dls", "keep": True, **NOISE}
    policy = Outer(Problem.of(scenario()), policy="calibrated", options=inner)
    state = learnt(policy, *arm, q)
    begun = learnt(policy, *arm, q[:1], state=state, start=np.array([True]))
    before, after = (memory(policy.inner, policy.inner_state(s)).estimates for s in (state, begun))
    assert np.abs(before).max() > 1e-4
    assert np.abs(after - before).max() < 0.1 * np.abs(before).max()


def test_noise_alone_is_no_change_of_the_arm():
    """Of what a camera measures as it was said, nothing is a surprise; nor where the noise is a fifth larger."""
    for noise in (5e-4, 6e-4):
        policy = made("calibrated", pose_noise=5e-4)
        assert memory(policy, learnt(policy, *perturbed(8), path(9, 300), noise)).quiet[0] == 300 + PAUSE


@pytest.mark.parametrize(
    ("name", "parameter", "change"),
    [
        ("calibrated", {"jump": 1e-3}, 1e-3),
        ("filter_bank", {"rate": 0.2}, 1e-3),
        ("filter_bank", {"rate": 0.2}, 1e-3 * np.array([1.0, -2.0, 1.5, 0.5, -1.0, 2.0, -1.0])),
    ],
)
def test_a_change_of_joint_zeros_is_noticed(name, parameter, change):
    """As by a payload: what was learnt for long is given up within some measurements, if they may change."""
    (arm, zeros), q, left = perturbed(8), path(9, 240), []
    for given in (parameter, dict.fromkeys(parameter, 0.0)):
        policy = made(name, **given)
        state = learnt(policy, arm, zeros, q, 3e-4, changed=(change, 220))
        missing = deviation_of(policy, state, q[-1]) - true_deviation(arm, zeros + change, q[-1])
        left.append(np.abs(missing).max())
    assert left[0] < 4e-4 < left[1]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("task", ikgym.tasks.names())
def test_the_base_policy_leads_another_arm_to_the_reference(name, task):
    """The first step of a base policy of gain 1 ends where the arm, not the model, is at the reference."""
    (arm, zeros), on = perturbed(1), scenario(task)
    policy = baselines.make(name, on, policy="dls", options={"damping": 1e-9}, **SETTLED[name])
    q = PANDA.home + 0.1
    reference = on.task.coordinates(*arm.forward(q + zeros + 1e-3))
    alone, seen = baselines.make("dls", on, damping=1e-9), observed(on, PANDA, 0.0, q, reference)
    actions = policy.predict(observed(on, arm, zeros, q, reference))[0], alone.predict(seen)[0]
    ends = (arm.forward(q + zeros + on.dt * action * on.velocity_limit) for action in actions)
    ours, theirs = (np.abs(on.task.error(reference, on.task.coordinates(*end))).max() for end in ends)
    assert ours < 1e-5
    assert theirs > 3e-4


@pytest.mark.parametrize("name", NAMES)
def test_late_and_missing_poses_are_held_against_the_posture_where_they_were_measured(name):
    """Poses are exact, but 3 steps old, and every other one is lost: nothing of the deviation is lost by that."""
    (arm, zeros), on, q = perturbed(2), scenario(), path(3, 60)
    policy, shown, age, state = made(name, **SETTLED[name]), q[0], -1.0, None
    for k in range(60):
        shown, age = (q[k - 3], 3.0) if k >= 3 and k % 2 == 1 else (shown, age + 1.0)
        pose = observed(on, arm, zeros, shown)["pose"]
        seen = observed(on, arm, zeros, q[k]) | {"pose": pose, "pose_age": np.array([age])}
        _, state = policy.predict(seen, state)
    assert np.abs(deviation_of(policy, state, q[-1]) - true_deviation(arm, zeros, q[-1])).max() < 2e-4
    assert np.abs(PANDA.forward(q[-1])[1] - PANDA.forward(q[-5])[1]).max() > 2e-2


def test_what_a_measurement_changes_is_blended_in():
    """The pose of a standing arm jumps by 1 mm: at once what the base policy does is nothing, then all of it."""
    on, q = scenario(), PANDA.home + 0.1
    seen, heights = observed(on, PANDA, 0.0, q), []
    off = seen | {"pose": seen["pose"] + np.eye(12)[-1] * 1e-3}
    for blend in (0.0, 0.01):
        policy, state, actions = made("offset_free", blend=blend, gain=1.0), None, []
        for shown in (seen, *[off] * 60):
            action, state = policy.predict({**shown, "nominal": seen["nominal"]}, state)
            actions.append(np.linalg.norm(action))
        heights.append(np.array(actions))
    at_once, blended = heights
    assert blended[1] < 0.2 * at_once[1]
    assert (np.diff(blended[1:40]) > 0.0).all()
    np.testing.assert_allclose(blended[-1], at_once[-1], rtol=0.05)


@functools.cache
def tracked(name):
    """Tracking cost of the second half of a short episode; the first is that of the start."""
    camera = {"pose_every": 17, "pose_delay": 5, "pose_missing": 0.1}
    noise = {"pose_noise": 3e-4, "pose_rotation_noise": 3e-4}
    plant = Plant(zero=1e-3, link=6e-4, axis=1e-3, **noise, **camera)
    on = ikgym.scenarios.get("panda-random").replace(dt=1e-3, steps=160, plant=plant)
    base = {"horizon": 3}
    parameters = base if name == "rhc" else {"policy": "rhc", "options": base}
    return np.mean([baselines.track(on, (name, parameters), seed=seed).tracking_cost[80:].sum() for seed in (1, 2)])


@pytest.mark.parametrize("name", NAMES)
def test_the_offset_of_a_wrong_arm_is_taken_back(name):
    """Of a base policy that only reads joint coordinates, behind a camera that is noisy, slow, late, and has gaps."""
    assert tracked(name) < 0.15 * tracked("rhc")
