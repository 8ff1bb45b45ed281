"""Joint velocities beyond their limits: cut joint by joint, or slowed down alike."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines.policy_kernels import scale_rows
from baselines.registry import get
from baselines.solvers.resolved_rate.base import ResolvedRate
from baselines.status import Status
from ikgym.exceptions import UnknownNameError

NAMES = [name for name in baselines.names() if issubclass(get(name), ResolvedRate)]
# Joint 0 is slower than an action can tell it to be.
LIMITS = np.array([5.0, 20.0, 20.0, 20.0, 20.0, 20.0, 20.0])


def shown(far):
    """A scenario whose model has a velocity limit, and an observation with a reference so many steps too far away."""
    scenario = ikgym.scenarios.get("varga7-pose-random")
    scenario = scenario.replace(arm=scenario.arm.replace(velocity_limit=LIMITS), velocity_limit=20.0)
    q = np.array([0.3, -0.6, 0.4, 0.8, -0.5, 0.7, 0.2])
    qdot = far * np.array([3.0, -2.0, 1.0, 4.0, -5.0, 2.0, -1.0])
    task, model = scenario.task, scenario.model
    nominal = task.coordinates(*model.forward(q + scenario.dt * qdot))
    pose = task.coordinates(*model.forward(q))
    return scenario, {"q": q, "qdot": 0 * q, "pose": pose, "nominal": nominal[None], "remaining": np.ones(1)}


def asked(policy, observation):
    action, state = policy.predict(observation)
    return action * policy.problem.velocity_limit, policy.report(state).status[0]


def test_there_are_some():
    assert {"dls", "moore_penrose", "null_space", "weighted_pseudoinverse", "broyden"} <= {*NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_scaling_keeps_the_direction(name):
    scenario, near = shown(0.01)
    clip, scale = (baselines.make(name, scenario, saturation=which) for which in ("clip", "scale"))
    assert clip.parameters == {**scale.parameters, "saturation": "clip"} == baselines.make(name, scenario).parameters
    np.testing.assert_array_equal(*(asked(policy, near)[0] for policy in (clip, scale)))
    _, far = shown(30.0)
    (cut, status), (slowed, same) = asked(clip, far), asked(scale, far)
    assert status == same == Status.SATURATED
    assert np.max(np.abs(slowed) / LIMITS) == pytest.approx(1.0, abs=1e-6)
    # An arm so fast that nothing is cut shows what was wanted.
    fast = scenario.replace(arm=scenario.arm.replace(velocity_limit=np.full(7, np.inf)), velocity_limit=1e6)
    given = {"weights": tuple((20.0 / LIMITS) ** 2)} if name == "weighted_pseudoinverse" else {}
    wanted, _ = asked(baselines.make(name, fast, **given), far)
    np.testing.assert_allclose(slowed, wanted / np.max(np.abs(wanted) / LIMITS), rtol=0, atol=1e-4)
    np.testing.assert_allclose(cut, np.clip(wanted, -20, 20), rtol=0, atol=0.1)


def test_rows_that_are_no_numbers_are_left_alone():
    qdot = np.array([[1.0, np.nan], [np.inf, 1.0], [np.nan, 9.0], [9.0, 3.0], [0.5, 0.1]])
    before, status = qdot.copy(), np.array([1, 1, 1, 3, 1])
    scale_rows(qdot, np.array([1.0, 2.0]), status)
    np.testing.assert_array_equal(qdot[:3], before[:3])
    np.testing.assert_allclose(qdot[3:], [[1.0, 1 / 3], [0.5, 0.1]], rtol=1e-15)
    assert status.tolist() == [1, 1, 1, 4, 1]


@pytest.mark.parametrize("name", NAMES)
def test_bad_saturations(name):
    with pytest.raises(UnknownNameError, match=r"no saturation 'scaled'\. Did you mean 'scale'\?"):
        baselines.make(name, "varga7-fast", saturation="scaled")
