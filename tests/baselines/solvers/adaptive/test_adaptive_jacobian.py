"""The adaptive Jacobian of Cheah, Liu and Slotine."""

from __future__ import annotations

import numpy as np

import baselines
import ikgym
from tests.baselines.solvers.adaptive.arms import PANDA, observed, path, perturbed, scenario


def test_without_adaptation_and_with_fresh_poses_it_is_damped_least_squares():
    (arm, zeros), on = perturbed(1), scenario()
    policies = [baselines.make("dls", on, gain=0.3), baselines.make("adaptive_jacobian", on, gain=0.3, adaptation=0.0)]
    states = [None, None]
    for q, target in zip(path(0, 5), path(1, 5), strict=True):
        seen = observed(on, arm, zeros, q, on.task.coordinates(*PANDA.forward(target)))
        answers = [policy.predict(seen, state) for policy, state in zip(policies, states, strict=True)]
        states = [state for _, state in answers]
        np.testing.assert_allclose(answers[0][0], answers[1][0], rtol=1e-6, atol=1e-7)


def tracked(adaptation, steps=400):
    """Largest errors over time, of a planar arm whose links are longer than the model says."""
    model = ikgym.arms.get("planar2")
    arm = model.replace(offsets=1.3 * model.offsets, tool=1.3 * model.tool)
    on = ikgym.scenarios.get("planar2-bent").replace(iterations_per_point=1, dt=0.01, steps=steps)
    policy = baselines.make("adaptive_jacobian", on, gain=0.05, damping=1e-9, adaptation=adaptation)
    q, state, errors = np.array([1.2, 0.8]), None, []
    time = np.arange(steps + 1)[:, None]
    nominal = arm.forward(q + 0.3 * np.sin(time * [0.05, 0.08]))[1]
    for k in range(steps):
        pose = on.task.coordinates(*arm.forward(q))
        seen = {"q": q, "qdot": 0.0 * q, "pose": pose, "nominal": nominal[k + 1][None], "remaining": np.ones(1)}
        action, state = policy.predict(seen, state)
        q = q + on.dt * action * on.velocity_limit
        errors.append(np.linalg.norm(nominal[k + 1] - arm.forward(q)[1]))
    return np.array(errors)


def test_the_tracking_error_of_wrong_links_is_adapted_away():
    fixed, adapted = tracked(0.0), tracked(10.0)
    assert adapted[-100:].mean() < 0.2 * fixed[-100:].mean()
    assert fixed[-100:].mean() > 1e-3


def test_a_late_pose_is_moved_along():
    """A pose of ten steps ago, exact on an exact model, says where the arm is now."""
    on, q = scenario(), path(2, 11)
    policy = baselines.make("adaptive_jacobian", on, gain=1.0, damping=1e-9, adaptation=0.0)
    state, target = None, on.task.coordinates(*PANDA.forward(q[-1] + 1e-3))
    old = observed(on, PANDA, np.zeros(7), q[0])["pose"]
    for k in range(11):
        seen = observed(on, PANDA, np.zeros(7), q[k], target) | {"pose": old, "pose_age": np.array([float(k)])}
        action, state = policy.predict(seen, state)
    fresh = observed(on, PANDA, np.zeros(7), q[-1], target)
    expected, _ = baselines.make("dls", on, gain=1.0, damping=1e-9).predict(fresh)
    np.testing.assert_allclose(action, expected, atol=2e-3 * np.abs(expected).max())
