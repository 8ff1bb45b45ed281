"""Where episodes begin on paths in space: the scenario finds joint coordinates for the first pose."""

import dataclasses

import gymnasium as gym
import numpy as np
import pytest

import ikgym
from baselines.fingerprints import fingerprint
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.trajectories import FixedOrientation, PathTrajectory, Quintic, Trajectory, paths

PANDA = ikgym.arms.get("panda")
DOWN = np.diag([1.0, -1.0, -1.0])


def line(*, begin=(0.5, 0.0, 0.3), orientation=True):
    path = paths.Line(np.array(begin), np.array([0.5, 0.2, 0.4]))
    return PathTrajectory(path, Quintic(0.2, 1.0), FixedOrientation(DOWN) if orientation else None)


def scenario(**changes):
    given = {"arm": PANDA, "task": ikgym.tasks.get("pose"), "trajectory": line(), "steps": 5}
    return Scenario("line", **{**given, **changes})


@pytest.mark.parametrize("task", ["pose", "axis", "position"])
def test_the_arm_begins_at_the_first_pose_within_its_limits(task):
    one = scenario(task=ikgym.tasks.get(task), trajectory=line(orientation=task != "position"))
    q = one.first_q(one.trajectory)
    error = one.task.error(one.nominal()[0], one.task.coordinates(*PANDA.forward(q)))
    assert abs(error).max() < 1e-8
    assert ((q >= PANDA.lower) & (q <= PANDA.upper)).all()
    np.testing.assert_array_equal(q, PANDA.inverse(DOWN if task != "position" else None, [0.5, 0.0, 0.3])[0])
    observation = ikgym.RedundantIKEnv(one).reset(seed=3)[0]
    np.testing.assert_array_equal(observation["q"], q)
    rows = gym.make_vec("RedundantIK-v0", num_envs=3, scenario=one).reset(seed=3)[0]
    np.testing.assert_array_equal(rows["q"], [q] * 3)


def test_a_path_that_begins_out_of_reach_is_refused():
    message = (
        r"Scenario 'line': expected a trajectory that begins where arm 'panda' can be, got one that begins "
        r"0\.\d+ m and \S+ rad from the nearest joint coordinates that were found within its limits; give a start"
    )
    with pytest.raises(InvalidInputError, match=message):
        scenario(trajectory=line(begin=(1.2, 0.0, 0.3)))
    with pytest.raises(InvalidInputError, match=r"begins 0\.\d+ m from the nearest"):
        scenario(trajectory=line(begin=(1.2, 0.0, 0.3), orientation=False), task=ikgym.tasks.get("position"))


@dataclasses.dataclass(frozen=True, eq=False)
class Somewhere(Trajectory):
    """A distribution over paths in space."""

    random = True

    def frames(self, times, model):
        raise NotImplementedError


def test_random_paths_in_space_need_a_start():
    with pytest.raises(InvalidInputError, match="a random Cartesian trajectory needs a start"):
        scenario(trajectory=Somewhere())


def test_what_the_start_is_found_from_belongs_to_the_digest():
    moved = PANDA.replace(home=PANDA.home + 0.1)
    assert fingerprint(scenario()) != fingerprint(scenario(arm=moved))
    assert fingerprint(scenario(start=PANDA.home)) == fingerprint(scenario(start=PANDA.home, arm=moved))


def written(tmp_path, rows, columns="x, y, z, qw, qx, qy, qz"):
    file = tmp_path / "points.csv"
    file.write_text("\n".join([columns, *(", ".join(map(str, row)) for row in rows)]), encoding="utf-8")
    return ikgym.trajectories.from_csv(file, speed=0.1, acceleration=1.0)


# Below its base a Panda points its tool down, not up.
LOW = [(0.6, 0.0, -0.1), (0.6, 0.1, -0.1)]


def test_positions_in_millimetres_are_named(tmp_path):
    far = [(*(1000.0 * x for x in point), 0, 1, 0, 0) for point in LOW]
    with pytest.raises(InvalidInputError, match=r"it is 60[08]\.\d* m away, and the arm 1\.\d+ m long: .* in \[mm\]"):
        scenario(trajectory=written(tmp_path, far))


def test_quaternions_in_another_order_are_named(tmp_path):
    down = written(tmp_path, [(*point, 0, 1, 0, 0) for point in LOW])
    assert scenario(trajectory=down).first_q(down).shape == (7,)
    up = written(tmp_path, [(*point, 1, 0, 0, 0) for point in LOW])
    with pytest.raises(InvalidInputError, match="quaternions read as x, y, z, w it is in reach: is that their order"):
        scenario(trajectory=up)
    up = written(tmp_path, [(*point, 0, 0, 1, 0) for point in LOW], "x, y, z, qx, qy, qz, qw")
    with pytest.raises(InvalidInputError, match="quaternions read as w, x, y, z it is in reach: is that their order"):
        scenario(trajectory=up)
