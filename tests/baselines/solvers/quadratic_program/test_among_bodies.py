"""The policies `qp` and `null_space` among bodies, in motion."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.solvers.quadratic_program.among_bodies import largest_approach
from ikgym.exceptions import InvalidInputError
from ikgym.obstacles import Box, Sphere
from ikgym.trajectories import PathTrajectory
from ikgym.trajectories.paths.polyline import Line
from ikgym.trajectories.time_laws import Quintic
from tests.baselines.solvers.quadratic_program.paths import circle, played
from tests.comparison import identical


def clear_scenario(obstacles=(), **changes):
    """A circle of the Panda with hand, and something next to its elbow."""
    return circle("panda-hand", radius=0.08, obstacles=obstacles, collisions=True, **changes)


def follows(scenario):
    episode = played(scenario)
    assert not episode.stopped.any()
    assert episode.clearance.min() > 4e-3
    assert episode.position_error.max() < 1e-4
    return episode


def test_a_pair_can_brake_before_it_reaches_the_clearance():
    for change in (1e-3, 1e-2, np.inf):
        distance, speed, dt = 0.2, 2.0, 1e-3
        while distance - 0.005 > 1e-6:
            allowed = largest_approach(distance, 0.005, dt, change, 0.25)
            assert allowed > 0.0
            slowest = speed - 2.0 * change  # the joints can make twice of what is reckoned with
            assert distance > 0.1 or allowed >= slowest - 1e-12
            speed = min(allowed, speed)
            distance -= speed * dt
        assert distance >= 0.005


NEARBY = Box("box", [0.12, 0.21, 0.62], [0.1, 0.1, 0.1])


def test_keeps_clear_of_a_box_that_comes():
    """A sphere moves to the elbow, which gives way; an arm that takes no notice is hit."""
    elbow = [0.05, 0.35, 0.6]
    motion = PathTrajectory(Line(elbow, [0.05, 0.1, 0.6]), Quintic(0.2, 1.0))
    scenario = clear_scenario((Sphere("ball", [0.0, 0.0, 0.0], 0.05, motion=motion),))
    policy, (seen, _) = baselines.make("qp", scenario), ikgym.RedundantIKEnv(scenario).reset(seed=0)
    with pytest.raises(InvalidInputError, match="obstacles"):
        policy.predict({key: value for key, value in seen.items() if key != "obstacles"})
    follows(scenario)
    assert played(scenario, "dls").stopped[-1]


@pytest.mark.parametrize("name", ["qp", "null_space"])
def test_a_batch_is_its_rows(name):
    scenario = clear_scenario((NEARBY,))
    policy, rng = baselines.make(name, scenario), np.random.default_rng(0)
    seen, _ = ikgym.RedundantIKEnv(scenario).reset(seed=0)
    rows = [{**seen, "q": seen["q"] + 0.02 * rng.normal(size=7)} for _ in range(5)]
    batch = {key: np.stack([row[key] for row in rows]) for key in seen}
    together = policy.predict(batch)[0]
    for row, action in zip(rows, together, strict=True):
        assert identical(policy.predict(row)[0], action)


@pytest.mark.parametrize("name", [name for name in ikgym.scenarios.names("bodies") if name != "panda-clutter-random"])
def test_every_path_among_bodies_can_be_followed_and_only_by_a_solver_that_looks_at_them(name):
    """Within all limits, and clear from the start to the end; `dls` is stopped, or the bodies would not matter."""
    scenario = ikgym.scenarios.get(name)
    episode = follows(scenario)
    assert not episode.at_limit.any()
    assert episode.orientation_error.max() < 1e-4
    assert played(scenario, "dls").stopped[-1]


def test_slow_joints_give_way_like_others():
    """With weights as in free space they leave it to the others, which costs 7 times as much."""
    scenario = ikgym.scenarios.get("tiago-table").replace(steps=100)
    weighed = baselines.make("qp", scenario.replace(collisions=False, obstacles=()))
    assert weighed.weights.max() > 10.0
    assert (baselines.make("qp", scenario).weights == 1.0).all()
    chosen = baselines.make("qp", scenario, joint_weights=tuple(weighed.weights))
    np.testing.assert_array_equal(chosen.weights, weighed.weights)


def test_null_space_leads_away():
    scenario = clear_scenario((NEARBY,))
    seen, _ = ikgym.RedundantIKEnv(scenario).reset(seed=0)
    policy = baselines.make("null_space", scenario, secondary_gain=0.0, repulsion=0.1)
    action = policy.predict(seen)[0]
    still = policy.replace(repulsion=0.0).predict(seen)[0]
    unit = scenario.dt * scenario.velocity_limit * (action.astype(float) - still)
    arm, q = scenario.arm, seen["q"]
    away = 1e-3 * unit / np.linalg.norm(unit)
    assert arm.clearance(q + away, (NEARBY,))[0] > arm.clearance(q, (NEARBY,))[0]
    np.testing.assert_allclose(arm.jacobian(q) @ away, 0.0, atol=1e-6)


def test_numbers_out_of_range():
    scenario = clear_scenario((NEARBY,))
    for settings in ({"influence": 0.004}, {"clearance": -1.0}, {"repulsion": 2.0 / scenario.dt}):
        with pytest.raises(InvalidInputError):
            baselines.make("qp", scenario, **settings)
