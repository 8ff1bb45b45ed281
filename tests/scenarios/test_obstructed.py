"""The problems of others with obstacles, as scenarios."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ikgym import problems, scenarios


@pytest.mark.parametrize("name", [*problems.OBSTRUCTED[:12], *problems.names("cppflow-panda"), "cppflow-fetch-s"])
def test_the_arm_begins_at_the_first_waypoint_and_touches_nothing(name):
    scenario, (positions, quaternions, starts) = scenarios.get(name), problems.waypoints(name)
    assert scenario.steps == 10 * (len(positions) - 1)
    nominal = scenario.nominal()[::10]
    np.testing.assert_allclose(nominal[:, 9:], positions, atol=1e-14)
    start = scenario.start_of()
    assert len(starts) == 1 or not starts.size
    rotation, position = scenario.arm.forward(start)
    np.testing.assert_allclose(position, positions[0], atol=1.5e-5)
    wanted = Rotation.from_quat(quaternions[0], scalar_first=True).as_matrix()
    np.testing.assert_allclose(rotation, wanted, atol=1e-3)
    assert scenario.arm.clearance(start, scenario.obstacles)[0] > 0.0 or name == "cppflow-panda-square"


def test_boxes_are_where_they_were_published():
    """Numbers of the files: centres in the base frame, edges, and the yaw of RL-ITG's only turned boxes."""
    assert problems.boxes("rlitg-square").tolist() == [[0.75, 0.0, 0.36, 0.70, 1.40, 0.72, 0.0]]
    assert problems.boxes("cppflow-panda-1cube").tolist() == [[0.0, 0.2, 0.7, 0.25, 0.25, 0.25, 0.0]]
    np.testing.assert_allclose(problems.boxes("cppflow-fetch-s")[0], [0.75, 0.0, 0.16, 0.70, 1.40, 0.72, 0.0])
    counts = [len(problems.boxes(name)) for name in problems.names("rlitg-obstacle")]
    assert (len(counts), sum(counts), max(counts)) == (100, 102, 3)
    turned = [row for name in problems.names("rlitg-obstacle") for row in problems.boxes(name).tolist() if row[6]]
    assert turned == [[0.51, 0.2, 0.625658483, 0.15, 0.15, 0.3, 0.3], [0.9, -0.4, 0.725658483, 0.15, 0.15, 0.7, -0.3]]
    name = next(name for name in problems.names("rlitg-obstacle") if len(problems.boxes(name)) == 3)
    box = scenarios.get(name).obstacles[1]
    np.testing.assert_allclose(box.rotation, Rotation.from_euler("z", 0.3).as_matrix(), atol=1e-12)
    assert problems.boxes("rlitg-hello").shape == (0, 7)
