import base64

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.evaluation.html.series import ACCELERATION, BUDGET, FEWEST, FREE, STOP, VELOCITY, limits, thin
from baselines.evaluation.log import FRAMES, frame_rows, trajectory_log
from tests.limited import limited


def log_of(scenario, seed=0, policy="dls"):
    return trajectory_log(rollout(scenario, baselines.make(policy, scenario), seed))


def decoded(array):
    """The array that was encoded, in single precision."""
    return np.frombuffer(base64.b64decode(array["data"]), dtype="<" + array["type"]).reshape(array["shape"])


@pytest.fixture(scope="module")
def log():
    return log_of(limited(steps=1000, dt=0.001))


def test_frames_are_spread_evenly_and_end_with_the_last_row():
    for rows in (1, 2, 399, 400, 401, 6283):
        frames = frame_rows(rows, FRAMES)
        assert len(frames) == min(rows, FRAMES)
        assert frames[-1] == rows - 1
        gaps = np.diff(frames, prepend=-1)
        assert 1 <= gaps.min() <= gaps.max() <= gaps.min() + 1


@pytest.mark.parametrize("name", ["panda-field", "panda-payload", "varga7-pose-random"])
def test_the_log_has_the_arm_that_moves(name):
    scenario = ikgym.scenarios.get(name)
    scenario = scenario.replace(
        steps=30, plant=scenario.plant.replace(payload_step=15) if scenario.plant.payload_step else scenario.plant
    )
    log = log_of(scenario, seed=5)
    np.testing.assert_allclose(log["tool"], log["pose"][:, -3:], atol=1e-6)
    np.testing.assert_allclose(log["tool_rotation"].reshape(-1, 9), log["pose"][:, :9], atol=1e-6)


def test_joints_are_where_the_arm_has_them(log):
    arm = limited().arm
    for row in (0, 200, FRAMES - 1):
        expected = arm.joint_points(log["q"][log["frame"][row]])
        np.testing.assert_allclose(log["joint_points"][row], expected, atol=1e-6)
    series = thin(log, BUDGET)
    points = decoded(series["arrays"]["points"])
    assert points.shape == (FRAMES, 2 + 7 + log["prismatic"].sum(), 3)
    assert (points[:, 0] == 0.0).all()  # the base
    np.testing.assert_array_equal(points[:, series["joint_ends"]], log["joint_points"][:, :, 1])
    np.testing.assert_array_equal(points[:, -1], log["tool"])


@pytest.mark.parametrize("size", [BUDGET, 30_000, 1])
def test_no_peak_is_lost_however_few_rows_are_kept(log, size):
    log = {name: values.copy() for name, values in log.items()}
    log["position_error"][333] = 7.0
    log["qdot"][334, 2], log["qdot"][335, 2] = -9.0, 8.0
    log["orientation_error"][100] = np.nan
    series = thin(log, size)
    if size == 30_000:
        assert 0.6 * size < sum(len(array["data"]) for array in series["arrays"].values()) <= size
    arrays = {name: decoded(values) for name, values in series["arrays"].items()}
    rows = len(arrays["time"])
    assert rows == {BUDGET: FRAMES, 1: FEWEST}.get(size, rows)
    assert arrays["position_error"].max() == 7.0
    assert arrays["qdot"].min() == -9.0
    assert np.isfinite(arrays["orientation_error"]).all()  # one of several steps
    place = int(np.argmax(arrays["position_error"]))
    before = arrays["time"][place - 1]
    assert before < np.float32(log["time"][333]) <= arrays["time"][place]
    assert arrays["time"][-1] == np.float32(log["time"][-1])


def test_limits_tell_the_most_severe():
    log = {
        "q": np.array([[0.0, 1.0, -1.0, 0.0, 0.0]]),
        "qdot": np.array([[0.0, 2.0, 0.0, -2.0, 1.0]]),
        "qddot": np.array([[0.0, 0.0, 3.0, 3.0, -3.0]]),
        "lower": np.full(5, -1.0), "upper": np.full(5, 1.0),
        "velocity_limit": np.full(5, 2.0), "acceleration_limit": np.full(5, 3.0),
    }  # fmt: skip
    assert limits(log).tolist() == [[FREE, STOP, STOP, VELOCITY, ACCELERATION]]
    without = {"lower": np.full(5, -np.inf), "upper": np.full(5, np.inf), "velocity_limit": np.full(5, np.inf)}
    assert limits({**log, **without, "acceleration_limit": np.full(5, np.inf)}).tolist() == [[FREE] * 5]
