"""Initial trajectories of others, played."""

import numpy as np
import pytest

import baselines
from baselines import registry
from ikgym import problems, scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError

SHORT = scenarios.get("rlitg-hello").replace(steps=200)


def test_it_is_at_the_published_joint_coordinates_at_the_waypoints():
    """Where no limit acts, what is played is what was published, except for the rounding of float32 actions."""
    method = "reinforcement"
    played = baselines.track(SHORT, f"published:{method}")
    joints = problems.get("rlitg-hello").trajectories[method][:21]
    np.testing.assert_allclose(played.q[9::10], joints[1:], atol=1e-7)
    assert played.parameters == {"method": method, "seed": None}
    # Straight on from waypoint to waypoint.
    np.testing.assert_allclose(played.q[4], (joints[0] + joints[1]) / 2, atol=1e-6)


def test_the_seed_says_which_path_it_plays():
    scenario = scenarios.get("rlitg-random").replace(steps=20)
    played = baselines.track(scenario, "published:greedy", seed=3)
    (name,) = [
        one
        for one in problems.names("rlitg-random-")
        if np.allclose(problems.get(one).positions[0], scenario.nominal(3)[0, 9:])
    ]
    np.testing.assert_allclose(played.q[9::10], problems.get(name).trajectories["greedy"][1:3], atol=1e-6)


def test_joints_without_limits_go_on_instead_of_jumping():
    name = "rlitg-random-041"
    joints = problems.get(name).trajectories["cloning"]
    assert np.abs(np.diff(joints, axis=0)).max() > 6.0
    path = registry.make("published", name, method="cloning").path
    assert np.abs(np.diff(path, axis=0)).max() < 0.1
    turns = (path[::10] - joints) / (2.0 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-12)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: registry.make("published", "varga7-fast"), InvalidInputError, "with a published path, got 'varga7"),
        (lambda: registry.make("published", "rlitg-kaist"), UnknownNameError, "Available: none"),
        (lambda: registry.make("published", SHORT, method="clonin"), UnknownNameError, "Did you mean 'cloning'"),
    ],
)
def test_bad_input(make, error, message):
    with pytest.raises(error, match=message):
        make()
