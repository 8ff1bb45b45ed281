"""The same paths for several arms: each demands what its name says, and no more."""

import numpy as np
import pytest
from scipy.optimize import linprog

from baselines.evaluate import evaluate
from ikgym import scenarios

ARMS = ("panda", "iiwa14", "tiago")
FAMILIES = ("circle", "lemniscate", "square", "raster", "line", "turn", "singular", "edge", "fast", "glue")
#: The control points that are singular postures: a stretched elbow, an aligned wrist. Two more precede the first.
STRETCHED, ALIGNED = 2 + 5, 2 + 5 + 20
each_arm = pytest.mark.parametrize("arm", ARMS)


@each_arm
def test_every_arm_has_every_path(arm):
    for name in FAMILIES:
        scenario = scenarios.get(f"{arm}-{name}")
        assert scenario.arm.name == scenario.model.name == arm
        assert scenario.task.name == ("axis" if name == "glue" else "pose")
        assert scenario.dt == (4e-3 if arm == "tiago" else 1e-3)
        np.testing.assert_array_equal(scenario.velocity_limit, scenario.arm.velocity_limit)
        slowest = scenario.arm.velocity_limit[~np.array(scenario.arm.prismatic)].min()
        assert scenario.cost.delta_qdot == pytest.approx(0.5 * slowest, abs=0.01)
        assert -1e-9 <= scenario.steps * scenario.dt - scenario.trajectory.duration < 0.1 + 1e-9


@each_arm
def test_a_stop_stands_in_the_way_of_a_turn(arm):
    scenario = scenarios.get(f"{arm}-turn")
    (row,) = evaluate([scenario.name], ["dls"])
    assert row.steps_at_joint_limit > 20
    assert row.joint_limit_margin_min == 0.0
    assert row.position_error_max > 1e-3


@each_arm
def test_the_edge_is_a_few_centimetres_out_of_reach(arm):
    scenario = scenarios.get(f"{arm}-edge")
    frames = scenario.frames(scenario.trajectory, scenario.steps + 1)[:: scenario.steps // 40]
    rotations, positions = frames[:, :9].reshape(-1, 3, 3), frames[:, 9:]
    q, converged = scenario.arm.inverse(rotations, positions)
    away = np.linalg.norm(scenario.arm.forward(q)[1] - positions, axis=1)
    assert 0.1 < np.mean(~converged) < 0.6
    assert converged[[0, 1, -2, -1]].all()
    assert 0.01 < away.max() < 0.06
    back = positions[np.argmax(away)] - [0.05, 0.0, 0.0]
    assert scenario.arm.inverse(rotations[0], back)[1]


@each_arm
def test_no_posture_is_fast_enough(arm):
    """At the fastest point, no joint velocity within the limits moves the tool as the path does."""
    scenario = scenarios.get(f"{arm}-fast")
    frames = scenario.frames(scenario.trajectory, scenario.steps + 1)
    twists = np.gradient(frames[:, 9:], scenario.dt, axis=0)
    k = int(np.argmax(np.linalg.norm(twists, axis=1)))
    rotation, position = frames[k, :9].reshape(3, 3), frames[k, 9:]
    limit, rng, tried = scenario.arm.velocity_limit, np.random.default_rng(0), 0
    for start in rng.uniform(scenario.arm.lower, scenario.arm.upper, (40, scenario.joints)):
        q, converged = scenario.arm.inverse(rotation, position, start)
        if converged:
            jacobian, twist = scenario.arm.jacobian(q), np.concatenate([twists[k], np.zeros(3)])
            bounds = np.column_stack([-limit, limit])
            assert linprog(np.zeros(len(limit)), A_eq=jacobian, b_eq=twist, bounds=bounds).status == 2
            assert linprog(np.zeros(len(limit)), A_eq=jacobian, b_eq=0.05 * twist, bounds=bounds).status == 0
            tried += 1
    assert tried > 20


@each_arm
def test_the_singular_path_passes_both_postures(arm):
    scenario = scenarios.get(f"{arm}-singular")
    control = scenario.trajectory.control
    path = scenario.nominal_joint_path()
    smallest = np.linalg.svd(scenario.arm.jacobian(path), compute_uv=False)[:, -1]
    for point in (STRETCHED, ALIGNED):
        k = round((point - 1) * 0.12 / scenario.dt)  # knots are 0.12 s apart
        np.testing.assert_allclose(path[k], control[point], atol=1e-9)
        assert smallest[k] < 1e-5
        assert smallest[k - 30] > 1e-3 < smallest[k + 30]
    moved = np.abs(np.diff(path, axis=0)) / scenario.dt
    assert (moved.max(axis=0) < scenario.arm.velocity_limit).all()
    assert (np.abs(np.diff(path, 2, axis=0)).max(axis=0) / scenario.dt**2 < scenario.arm.acceleration_limit).all()
    assert ((path > scenario.arm.lower) & (path < scenario.arm.upper)).all()
