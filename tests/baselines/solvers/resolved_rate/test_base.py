"""Moore–Penrose and damped least squares against NumPy, and the feedback law."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from tests.baselines.solvers.resolved_rate.inverting import invert
from tests.every_scenario import ONE_OF_EACH

NAMES = ONE_OF_EACH


def jacobians(scenario, rows=20):
    rng = np.random.default_rng(0)
    q = np.vstack([rng.uniform(-2, 2, (rows, scenario.joints)), np.zeros((1, scenario.joints))])
    rotation, _, geometric = scenario.model.forward_and_jacobian(q)
    jacobian = scenario.task.jacobian(rotation, geometric)
    return jacobian, rng.normal(size=jacobian.shape[:2]) * 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_moore_penrose_is_the_pseudoinverse(name):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    step, status = invert(baselines.make("moore_penrose", scenario), jacobian, shift)
    for j, dx, dq, s in zip(jacobian, shift, step, status, strict=True):
        rank = np.linalg.matrix_rank(j, tol=1e-12 * np.linalg.norm(j, 2))
        wanted = np.linalg.pinv(j, rcond=1e-12) @ dx
        condition = np.linalg.svd(j, compute_uv=False)[rank - 1] / np.linalg.norm(j, 2)
        np.testing.assert_allclose(dq, wanted, atol=1e-14 * np.linalg.norm(wanted) / condition)
        full = min(scenario.task.error_size, scenario.joints, 6)
        assert s == (Status.APPLIED if rank == full else Status.RANK_DEFICIENT)


def test_rank_is_lost_at_home():
    """The paper's home pose is singular, in both readings."""
    for name in ("varga7-fast", "varga7-literal-fast"):
        policy = baselines.make("moore_penrose", name)
        observation, _ = gym.make("RedundantIK-v0", scenario=name).reset()
        _, state = policy.predict(observation)
        assert policy.report(state).status[0] == Status.RANK_DEFICIENT


@pytest.mark.parametrize("damping", [1e-6, 1e-3, 0.5])
@pytest.mark.parametrize("name", NAMES)
def test_dls_minimises_the_damped_squares(name, damping):
    """As least squares of the augmented system [J; √λ I] Δq = [Δx; 0], which squares no condition number."""
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    step, _ = invert(baselines.make("dls", scenario, damping=damping), jacobian, shift)
    for j, dx, dq in zip(jacobian, shift, step, strict=True):
        augmented = np.vstack([j, damping**0.5 * np.eye(scenario.joints)])
        wanted = np.linalg.lstsq(augmented, np.concatenate([dx, np.zeros(scenario.joints)]), rcond=None)[0]
        np.testing.assert_allclose(dq, wanted, rtol=1e-6, atol=1e-8 * np.linalg.norm(wanted))


@pytest.mark.parametrize("gain", [0.1, 0.5, 1.0, 1.5])
def test_gain_is_the_share_of_the_error_taken_back(gain):
    """At rest, an error e becomes (1 - gain) e in one step."""
    scenario = ikgym.scenarios.get("faitli3-regular")
    here = np.array([0.1, 0.4, 1.0])
    still = scenario.replace(trajectory=ikgym.trajectories.Sinusoid(np.zeros(3), offset=here))
    env = gym.make("RedundantIK-v0", scenario=still, preview=1)
    policy = baselines.make("moore_penrose", still, gain=gain)
    observation, _ = env.reset(options={"q": here + 1e-5})
    state, errors = None, []
    for _ in range(4):
        errors.append(observation["nominal"][0] - observation["pose"])
        action, state = policy.predict(observation, state)
        observation, *_ = env.step(action)
    # At the first step nothing is known of X^N(k): all that is missing counts as nominal motion.
    np.testing.assert_allclose(errors[1], 0, atol=1e-8)
    observation, _ = env.reset(options={"q": here})
    _, state = policy.predict(observation, None)
    observation, _ = env.reset(options={"q": here + 1e-5})
    before = observation["nominal"][0] - observation["pose"]
    action, _ = policy.predict(observation, state)
    observation, *_ = env.step(action)
    after = observation["nominal"][0] - observation["pose"]
    np.testing.assert_allclose(after, (1 - gain) * before, atol=1e-8)


@pytest.mark.parametrize("name", ["moore_penrose", "dls"])
def test_tracks_a_regular_trajectory(name):
    scenario = ikgym.scenarios.get("faitli3-regular").replace(steps=300)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=1)
    policy = baselines.make(name, scenario)
    observation, _ = env.reset()
    state = None
    for _ in range(300):
        action, state = policy.predict(observation, state)
        observation, *_, info = env.step(action)
        assert not info["clipped"]
        assert info["position_error"] < (1e-5 if name == "moore_penrose" else 1e-4)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("dls", {"damping": 0.0}, "damping: expected a finite number above 0"),
        ("dls", {"damping": np.nan}, "damping: expected a finite number above 0, got nan"),
        ("dls", {"gain": 0.0}, "gain: expected a finite number above 0"),
        ("moore_penrose", {"gain": 2.0}, "gain: expected a number above 0 and below 2, got 2"),
        ("moore_penrose", {"rank_tolerance": 2.0}, "rank_tolerance: expected a number below 1, got 2"),
        ("moore_penrose", {"rank_tolerance": -1.0}, "rank_tolerance: expected a finite number of at least 0"),
    ],
)
def test_bad_parameters(name, change, message):
    with pytest.raises(InvalidInputError, match=message):
        baselines.make(name, "varga7-fast", **change)


@pytest.mark.parametrize(("delay", "limit"), [(2, 0.62), (12, 0.13)])
def test_a_delay_lowers_the_largest_stable_gain(delay, limit):
    """As the docstring says: errors die out a tenth below the limit, and grow a tenth above."""
    scenario = ikgym.scenarios.get("panda-circle").replace(steps=1200, plant=ikgym.Plant(command_delay=delay))
    assert 2.0 * np.sin(np.pi / (2 * (2 * delay + 1))) == pytest.approx(limit, rel=0.04)
    late = [
        rollout(scenario, baselines.make("dls", scenario, gain=share * limit), 0, timed=False)
        .position_error[-100:]
        .max()
        for share in (0.9, 1.1)
    ]
    assert late[0] < 0.02
    assert late[1] > 10.0 * late[0]
