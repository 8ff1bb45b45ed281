"""Waypoints from arrays and CSV files."""

import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ikgym
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.trajectories import FixedOrientation, PathTrajectory, Quintic, TimedWaypoints, Trapezoidal, from_csv, through
from ikgym.trajectories.paths import Polyline, SplinePath

ARM = ikgym.arms.get("varga7")
POINTS = np.random.default_rng(0).uniform(-1, 1, (5, 3))
TURNS = Rotation.from_rotvec(np.random.default_rng(1).uniform(-0.8, 0.8, (5, 3)))
QUATERNIONS = TURNS.as_quat(scalar_first=True)
TIMES = np.array([0.5, 1.0, 1.7, 3.0, 4.0])


def test_times_that_are_given_are_kept():
    frames = through(POINTS, QUATERNIONS, times=TIMES).frames(TIMES, ARM)
    np.testing.assert_allclose(frames[:, 9:], POINTS, atol=1e-14)
    np.testing.assert_allclose(frames[:, :9].reshape(-1, 3, 3), TURNS.as_matrix(), atol=1e-14)
    # At rest at both ends, smooth in between.
    dt = 1e-4
    frames = through(POINTS, QUATERNIONS, times=TIMES).frames(np.arange(0.0, 5.0, dt), ARM)
    rates = np.diff(frames, axis=0) / dt
    assert not rates[:4990].any()
    assert not rates[40010:].any()
    assert np.abs(np.diff(rates, axis=0)).max() < 0.02 * np.abs(rates).max()
    np.testing.assert_allclose(through(POINTS, times=TIMES).frames(TIMES, ARM), POINTS, atol=1e-14)


def test_times_that_are_worked_out():
    smooth = through(POINTS, QUATERNIONS, speed=0.5, acceleration=2.0)
    assert isinstance(smooth, PathTrajectory)
    assert isinstance(smooth.path, SplinePath)
    assert smooth.time_law == Quintic(0.5, 2.0)
    corners = through(POINTS, speed=0.5, acceleration=2.0, corner_radius=0.05, time_law="trapezoidal")
    assert isinstance(corners.path, Polyline)
    assert corners.time_law == Trapezoidal(0.5, 2.0)
    assert corners.orientation is None
    fixed = FixedOrientation(np.eye(3))
    assert through(POINTS, speed=1.0, acceleration=1.0, orientation=fixed).orientation is fixed


HEAD = "x, y, z, qw, qx, qy, qz, t\n"


def written(tmp_path, text):
    file = tmp_path / "points.csv"
    file.write_text(text, encoding="utf-8")
    return file


def test_a_file_gives_what_its_arrays_give(tmp_path):
    rows = np.column_stack([POINTS, QUATERNIONS, TIMES])
    text = HEAD + "\n".join(", ".join(map(repr, row)) for row in rows.tolist()) + "\n\n"
    got = from_csv(written(tmp_path, text))
    assert isinstance(got, TimedWaypoints)
    np.testing.assert_array_equal(got.frames(TIMES, ARM), through(POINTS, QUATERNIONS, times=TIMES).frames(TIMES, ARM))
    text = "\ufeffz,x,y\n" + "\n".join(",".join(map(repr, row[[2, 0, 1]].tolist())) for row in POINTS)
    got = from_csv(written(tmp_path, text), speed=0.5, acceleration=2.0, corner_radius=0.05)
    np.testing.assert_array_equal(got.path.points, POINTS)


TIMING = {"speed": 1.0, "acceleration": 1.0}


@pytest.mark.parametrize(
    ("rows", "given"),
    [
        (100_000, TIMING),
        *(pytest.param(200_000, one, marks=pytest.mark.slow) for one in (TIMING, TIMING | {"corner_radius": 1e-4}, {})),
    ],
)
def test_the_largest_file_takes_seconds(rows, given, tmp_path):
    """The time of the process, since other tests run meanwhile; samples of all intervals at once took 35 s, 5.9 GiB."""
    s = 0.01 * np.arange(rows)
    columns = [np.cos(s), np.sin(s), 0.01 * s, np.cos(s), np.sin(s), 0.0 * s, 0.0 * s, s][: 7 if given else 8]
    file, head = tmp_path / "points.csv", ",".join(HEAD.split(",")[: len(columns)]).strip()
    np.savetxt(file, np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.6f")
    begin = time.process_time()
    from_csv(file, **given).frames(np.linspace(0.0, 1.0, 1000), ARM)
    assert time.process_time() - begin < 10.0 * rows / 200_000


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "points.csv: expected the columns x, y, z in the first line, got none"),
        ("x,y\n1,2\n", "expected the columns x, y, z in the first line, got x, y; z missing"),
        ("x,y,z,qw\n1,2,3,1\n", "expected the columns x, y, z, qw, qx, qy, qz .* qx, qy, qz missing"),
        ("x,y,z,x\n1,2,3,4\n", "expected each column once, got x, y, z, x"),
        ("1,2,3\n4,5,6\n", "no column '1' in .*points.csv"),
        ("x,y,z\n1,2,3\n4,,6\n", "points.csv, line 3, column y: expected a finite number, got nothing"),
        ("x,y,z\n1,2,3\n4,5\n", "points.csv, line 3: expected 3 values, got 2"),
        ("x,y,z\n1,2,3\n\n4,5,6\n", "points.csv, line 3: expected 3 values, got 0"),
        ("x,y,z\n1,2,nan\n4,5,6\n", "line 2, column z: expected a finite number, got 'nan'"),
        ("x,y,z\n1,2,three\n4,5,6\n", "line 2, column z: expected a finite number, got 'three'"),
        ("x,y,z\n1,2,3\n", "points.csv: points: expected from 2 to 200000 waypoints, got 1"),
        ("x,y,z\n", "points.csv: points: expected from 2 to 200000 waypoints, got 0"),
        ("x,y,z\n1,2,0\0\n", "line 2, column z: expected a finite number, got"),
        ("x,y,z\n1,2," + "3" * 2**18 + "\n", "expected a CSV file: field larger than"),
        ("x,y,z\n" + "\n" * 3 * 10**5, "expected at most 200000 waypoints, got more"),
        (HEAD + "1,2,3,1,0,0,0,0\n", "points.csv: times: expected from 2 to 200000 waypoints, got 1"),
        (HEAD + "1,2,3,1,0,0,0,0\n4,5,6,1,0,0,0,0\n", "rise, got 0 s and 0 s as numbers 0 and 1"),
        (HEAD + "1,2,3,1,0,0,0,-1\n4,5,6,1,0,0,0,0\n", "expected times from 0 on, got -1 s as the first"),
        (HEAD + "1,2,3,1,0,0,0,0\n4,5,6,1,1,0,0,1\n", "expected unit quaternions, .* of length 1.41421 as number"),
    ],
)
def test_bad_files(text, message, tmp_path):
    law = {} if "t\n" in text else {"speed": 1.0, "acceleration": 1.0}
    with pytest.raises((InvalidInputError, UnknownNameError), match=message):
        from_csv(written(tmp_path, text), **law)
