"""The problems of others as scenarios."""

import gymnasium as gym
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ikgym import problems, scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.comparison import identical

NAMES = scenarios.names("published")
#: Control steps from waypoint to waypoint.
STEPS = 10
RANDOM = scenarios.get("rlitg-random")


def waypoint_steps(waypoints):
    """The control steps at which the waypoints are reached; the first one is the start."""
    return range(0, STEPS * (waypoints - 1) + 1, STEPS)


def test_names():
    made = {*problems.names("rlitg-random-"), *problems.OBSTRUCTED}
    assert {*problems.names()} - made == {*NAMES} - {"rlitg-random"}
    assert not set(NAMES) & set(scenarios.names())
    assert scenarios.find("rlitg-random-007") is scenarios.get("rlitg-random-007")
    with pytest.raises(UnknownNameError, match="There is no scenario 'rlitg-random-100'"):
        scenarios.get("rlitg-random-100")
    with pytest.raises(InvalidInputError, match="'rlitg-hello' is registered already"):
        scenarios.register("rlitg-hello", lambda: RANDOM)


@pytest.mark.parametrize(
    "name",
    [
        *(name for name in NAMES if name != "rlitg-random"),
        "rlitg-random-038",
        *problems.OBSTRUCTED[:12],
        *problems.names("cppflow-panda"),
        "cppflow-fetch-s",
    ],
)
def test_the_waypoints_are_met_at_their_steps_from_a_clear_start_on(name):
    scenario = scenarios.get(name)
    positions, quaternions, starts, *_ = problems.get(name)
    steps = waypoint_steps(len(positions))
    assert steps[-1] == scenario.steps
    nominal = scenario.nominal()[steps]
    np.testing.assert_allclose(nominal[:, 9:], positions, atol=1e-14)
    wanted = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
    np.testing.assert_allclose(nominal[:, :9].reshape(-1, 3, 3), wanted, atol=1e-12)
    first = scenario.start_of()
    rotation, position = scenario.arm.forward(first)
    np.testing.assert_allclose(position, positions[0], atol=1.5e-5)
    np.testing.assert_allclose(rotation, wanted[0], atol=1e-3)
    assert (scenario.arm.lower <= first).all()
    assert (first <= scenario.arm.upper).all()
    assert not len(starts) or identical(first, starts[0])
    assert scenario.arm.clearance(first, scenario.obstacles)[0] > 0.0 or not scenario.obstacles


def test_the_seed_chooses_a_path_and_its_start():
    drawn = [RANDOM.trajectory.sample(np.random.default_rng(seed)) for seed in range(1200)]
    assert {one.problem for one in drawn} == set(problems.names("rlitg-random-"))
    env = gym.make("RedundantIK-v0", scenario="rlitg-random")
    starts = [env.reset(seed=seed)[0]["q"] for seed in (3, 4, 3)]
    assert identical(starts[0], starts[2])
    assert not identical(starts[0], starts[1])
    published = [problems.get(name).starts[0] for name in problems.names("rlitg-random-")]
    assert all(any(identical(one, start) for start in published) for one in starts)


def test_what_is_out_of_reach():
    for name, missed in {"cppflow-panda-square": range(153, 182), "cppflow-fetch-rot_yz": ()}.items():
        scenario, (positions, quaternions, *_) = scenarios.get(name), problems.get(name)
        rotations = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
        converged = scenario.arm.inverse(rotations, positions, restarts=300)[1]
        assert np.flatnonzero(~converged).tolist() == list(missed)
