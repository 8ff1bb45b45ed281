"""The problems of others: complete, as they were published, and in the frames that they are said to be in."""

import hashlib

import numpy as np
from scipy.spatial.transform import Rotation

import ikgym
from ikgym import problems

RANDOM = problems.names("rlitg-random-")
DRAWN = [name for name in problems.NAMES if name not in (*RANDOM, *problems.OBSTRUCTED)]


def test_names():
    assert len(problems.names()) == len(set(problems.names())) == 220
    assert len(RANDOM) == 100


def test_the_numbers_have_not_changed():
    digest = hashlib.sha256()
    for name in (*DRAWN[:5], *RANDOM, *DRAWN[5:], *problems.OBSTRUCTED):
        *arrays, trajectories = problems.get(name)
        for array in (*arrays, *trajectories.values()):
            digest.update(np.rint(1e6 * array).astype(np.int64).tobytes())
    assert digest.hexdigest()[:12] == "72e2c5cc1574"


def test_the_first_waypoints_are_where_the_published_starts_are():
    """Base, tool, order of the quaternions and rest posture of the torso: all would show here."""
    arm = ikgym.arms.get("fetch_arm")
    for name in (*DRAWN[:5], *RANDOM):
        positions, quaternions, starts, *_ = problems.get(name)
        rotations, there = arm.forward(starts)
        assert np.linalg.norm(there - positions[0], axis=1).max() < 1.5e-5
        wanted = Rotation.from_quat(quaternions[0], scalar_first=True)
        assert (Rotation.from_matrix(rotations) * wanted.inv()).magnitude().max() < 1e-3


def test_published_trajectories_belong_to_their_paths():
    assert {name for name in problems.NAMES if problems.get(name).trajectories} == {
        *("rlitg-hello", "rlitg-rotation", "rlitg-zig"),
        *RANDOM,
        "rlitg-square",
        *problems.names("rlitg-obstacle-"),
    }
    for name in ("rlitg-hello", "rlitg-random-042"):
        positions, _, starts, _, trajectories = problems.get(name)
        assert tuple(trajectories) == ("greedy", "cloning", "reinforcement")
        for q in trajectories.values():
            assert q.shape == (len(positions), 7)
            assert not q.flags.writeable
            np.testing.assert_allclose(q[0], starts[0], atol=1e-5)


def test_boxes_are_where_they_were_published():
    """Numbers of the files: centres in the base frame, edges, and the yaw of RL-ITG's only turned boxes."""
    assert problems.get("rlitg-square").boxes.tolist() == [[0.75, 0.0, 0.36, 0.70, 1.40, 0.72, 0.0]]
    assert problems.get("cppflow-panda-1cube").boxes.tolist() == [[0.0, 0.2, 0.7, 0.25, 0.25, 0.25, 0.0]]
    np.testing.assert_allclose(problems.get("cppflow-fetch-s").boxes[0], [0.75, 0.0, 0.16, 0.70, 1.40, 0.72, 0.0])
    counts = [len(problems.get(name).boxes) for name in problems.names("rlitg-obstacle")]
    assert (len(counts), sum(counts), max(counts)) == (100, 102, 3)
    turned = [row for name in problems.names("rlitg-obstacle") for row in problems.get(name).boxes.tolist() if row[6]]
    assert turned == [[0.51, 0.2, 0.625658483, 0.15, 0.15, 0.3, 0.3], [0.9, -0.4, 0.725658483, 0.15, 0.15, 0.7, -0.3]]
    name = next(name for name in problems.names("rlitg-obstacle") if len(problems.get(name).boxes) == 3)
    box = ikgym.scenarios.get(name).obstacles[1]
    np.testing.assert_allclose(box.rotation, Rotation.from_euler("z", 0.3).as_matrix(), atol=1e-12)
    assert problems.get("rlitg-hello").boxes.shape == (0, 7)
