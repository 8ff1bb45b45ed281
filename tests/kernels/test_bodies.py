"""Distances of an arm's bodies and their gradients; coal judges each pair in test_segments.py."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import ikgym
from ikgym.arms.bodies import Bodies
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.kernels.bodies import near_rows
from ikgym.obstacles import Box, Capsule, HalfSpace, Sphere
from tests.arms.drawing import postures

#: A step of joint coordinates, and how much a gradient changes over ten of them where there is no kink.
STEP, SMOOTH = 1e-6, 1e-2
AROUND_X = [[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]]
#: One of each kind, large ones that bodies are deep in among them.
OBSTACLES = (
    *(Box(f"box{i}", at, [0.1, 0.2, 0.25], AROUND_X) for i, at in enumerate([[0.6, 0.3, 0.5], [-0.4, 0.5, 0.8]])),
    Sphere("ball", [0.5, 0.3, 0.4], 0.1),
    Capsule("bar", [-0.5, -0.5, 0.3], [0.5, -0.5, 0.6], 0.05),
    HalfSpace("floor", [0, 0, 0.2], [0.1, 0, 1]),
    Box("block", [0.4, 0.4, 0.4], [0.8, 0.6, 0.7]),
)
RAIL = ikgym.Arm(
    "rail",
    [[0.0, 0, 0], [0, 0, 0.5], [0.4, 0, 0], [0, 0, 0.4]],
    [[1.0, 0, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1]],
    (True, False, False, True),
    lower=[-1, -3, -3, -0.3],
    upper=[1, 3, 3, 0.3],
    bodies=Bodies(
        ("column", "upper", "lower", "tip"),
        (0, 2, 3, 4),
        [[0.2, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]],
        [[0.2, 0, 0.4], [0.4, 0, 0], [0, 0, 0.4], [0, 0, 0]],
        (0.1, 0.06, 0.05, 0.07),
    ),
)
ARMS = {"panda-hand": ikgym.arms.get("panda-hand"), "rail": RAIL}

every_arm = pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)


def near(arm, q, obstacles=OBSTACLES, within=np.inf, most=None):
    """For each posture the pairs with distances and gradients, the nearest first; all of them by default."""
    around, rows = arm.bodies.surroundings(obstacles), len(q)
    most = len(arm.bodies.pairs) + int(around.checked.sum()) if most is None else most
    counts, distances = np.empty(rows, dtype=np.int64), np.empty((rows, most))
    pairs, gradients = np.empty((rows, most, 2), dtype=np.int64), np.empty((rows, most, arm.joints))
    near_rows(arm.chain, arm.bodies.shapes, *around, q, within, counts, distances, pairs, gradients)
    parts = zip(counts, distances, pairs.tolist(), gradients, strict=True)
    return [[(*one,) for one in zip(d[:n], map(tuple, p[:n]), g[:n], strict=True)] for n, d, p, g in parts]


def by_pair(found):
    return [{pair: (distance, gradient) for distance, pair, gradient in row} for row in found]


@every_arm
def test_the_smallest_is_that_of_all_pairs(arm):
    q = postures(arm, 100)
    distances, pairs = arm.clearance(q.reshape(4, 25, arm.joints), OBSTACLES)
    distances, pairs, everything = distances.reshape(100), pairs.reshape(100, 2), near(arm, q)
    np.testing.assert_array_equal(distances, [row[0][0] for row in everything])
    assert (distances < -0.1).any()
    assert (distances > 0.0).any() or arm is not RAIL
    for i, row in enumerate(everything):
        distance, pair = arm.clearance(q[i], OBSTACLES)
        assert (distance, *pair) == (distances[i], *pairs[i])
        assert row[0][1] == (*pair,) or row[1][0] == distance


@every_arm
def test_all_pairs_that_can_meet_are_measured(arm):
    """All but one of a body that ignores an obstacle."""
    obstacles, last = (*OBSTACLES[:-1], OBSTACLES[-1].replace(ignored=arm.bodies.names[-1:])), len(arm.bodies) - 1
    (row,) = near(arm, postures(arm, 1), obstacles)
    moving = [body for body, link in enumerate(arm.bodies.links) if link > 0]
    wanted = {(body, len(arm.bodies) + i) for i in range(len(OBSTACLES)) for body in moving}
    wanted |= {*map(tuple, arm.bodies.pairs.tolist())}
    assert {pair for _, pair, _ in row} == wanted - {(last, last + len(OBSTACLES))}


@every_arm
@pytest.mark.parametrize(("within", "most"), [(0.1, 1000), (0.1, 3), (np.inf, 5), (-0.05, 4)])
def test_near_pairs_are_the_nearest_of_all(arm, within, most):
    q = postures(arm, 20)
    for row, everything in zip(near(arm, q, within=within, most=most), near(arm, q), strict=True):
        wanted = [distance for distance, *_ in everything if distance < within][:most]
        assert [distance for distance, *_ in row] == wanted


@every_arm
def test_gradients_agree_with_central_differences_away_from_kinks(arm):
    smooth, kinks = 0, 0
    for q in postures(arm, 10):
        (here,) = by_pair(near(arm, q[None]))
        ahead, behind, far, farther = (
            by_pair(near(arm, q + step * np.eye(arm.joints))) for step in (STEP, -STEP, 10 * STEP, -10 * STEP)
        )
        for pair, (_, gradient) in here.items():
            differences = np.array([a[pair][0] - b[pair][0] for a, b in zip(ahead, behind, strict=True)]) / (2 * STEP)
            jump = max(np.abs(one[pair][1] - gradient).max() for one in (*far, *farther))
            if jump > SMOOTH:
                kinks += 1
                continue
            smooth += 1
            np.testing.assert_allclose(gradient, differences, rtol=1e-6, atol=1e-6 * max(1e-2, abs(gradient).max()))
    assert kinks < 0.02 * smooth


def test_without_bodies_or_rows_nothing_is_met():
    distances, pairs = RAIL.replace(bodies=Bodies()).clearance(np.zeros((2, 4)), OBSTACLES)
    assert (distances == np.inf).all()
    assert (pairs == -1).all()
    assert RAIL.clearance(np.zeros((2, 0, 4)), OBSTACLES)[1].shape == (2, 0, 2)


def test_bad_input_is_refused():
    for q in (np.zeros(3), np.full(4, np.nan), "q", 0.0):
        with pytest.raises(InvalidInputError, match="q: expected"):
            RAIL.clearance(q)
    with pytest.raises(UnknownNameError, match="Did you mean 'tip'"):
        RAIL.clearance(np.zeros(4), [Sphere("ball", [0, 0, 0], 1.0, ignored=("tipp",))])


def test_plain_python_measures_the_same():
    code = (
        "import json, warnings; warnings.simplefilter('ignore')\n"
        "from tests.arms.drawing import postures\n"
        "from tests.kernels.test_bodies import OBSTACLES, RAIL, near\n"
        "print(json.dumps([[p, d, *g] for row in near(RAIL, postures(RAIL, 5)) for d, p, g in row]))"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    plain = json.loads(out.stdout)
    compiled = [[p, d, *g] for row in near(RAIL, postures(RAIL, 5)) for d, p, g in row]
    assert [tuple(pair) for pair, *_ in plain] == [pair for pair, *_ in compiled]
    np.testing.assert_allclose([row[1:] for row in plain], [row[1:] for row in compiled], rtol=0, atol=1e-14)
