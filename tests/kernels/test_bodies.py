import json
import os
import subprocess
import sys

import numpy as np
import pytest

import ikgym
from benchmarks.bodies import postures, ten_boxes
from ikgym.arms.bodies import Bodies
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.kernels.bodies import near_rows
from ikgym.obstacles import Box, Capsule, HalfSpace, Sphere

#: A step of joint coordinates, and how much a gradient changes over ten of them where there is no kink.
STEP, SMOOTH = 1e-6, 1e-2
#: One of each kind, large ones that bodies are deep in among them.
OBSTACLES = (
    *ten_boxes()[:3],
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
    q = postures(arm, 300)
    distances, pairs = arm.clearance(q, OBSTACLES)
    everything = near(arm, q)
    np.testing.assert_array_equal(distances, [row[0][0] for row in everything])
    assert (distances < -0.1).any()
    assert (distances > 0.0).any() or arm is not RAIL
    for pair, row in zip(pairs.tolist(), everything, strict=True):
        assert row[0][1] == tuple(pair) or row[1][0] == row[0][0]


@every_arm
def test_all_pairs_that_can_meet_are_measured(arm):
    (row,) = near(arm, postures(arm, 1))
    moving = [body for body, link in enumerate(arm.bodies.links) if link > 0]
    wanted = {*map(tuple, arm.bodies.pairs.tolist())}
    wanted |= {(body, len(arm.bodies) + i) for i in range(len(OBSTACLES)) for body in moving}
    assert {pair for _, pair, _ in row} == wanted


@every_arm
@pytest.mark.parametrize(("within", "most"), [(0.1, 1000), (0.1, 3), (np.inf, 5), (-0.05, 4)])
def test_near_pairs_are_the_nearest_of_all(arm, within, most):
    q = postures(arm, 50)
    for row, everything in zip(near(arm, q, within=within, most=most), near(arm, q), strict=True):
        wanted = [distance for distance, *_ in everything if distance < within][:most]
        assert [distance for distance, *_ in row] == wanted


@every_arm
def test_gradients_agree_with_central_differences_away_from_kinks(arm):
    smooth, kinks = 0, 0
    for q in postures(arm, 20):
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


@every_arm
def test_a_batch_equals_its_rows_bit_for_bit(arm):
    q = postures(arm, 20)
    distances, pairs = arm.clearance(q, OBSTACLES)
    for i, row in enumerate(q):
        distance, pair = arm.clearance(row, OBSTACLES)
        assert distance == distances[i]
        np.testing.assert_array_equal(pair, pairs[i])


@pytest.mark.parametrize("lead", [(), (1,), (0,), (2, 3), (2, 0)], ids=str)
def test_shapes_follow_those_of_q(lead):
    distances, pairs = RAIL.clearance(np.zeros((*lead, 4)), OBSTACLES)
    assert distances.shape == lead
    assert pairs.shape == (*lead, 2)


def test_pairs_are_bodies_and_obstacles():
    names = (*RAIL.bodies.names, "ball", "floor")
    floor = HalfSpace("floor", [0, 0, 0.3], [0, 0, 2.0])
    for ball, wanted, pair in (
        ([0.4, 0, 1.5], 1.5 - 0.9 - 0.07 - 0.1, ("tip", "ball")),
        ([2.4, 0, 1.5], 0.5 - 0.3 - 0.06, ("upper", "floor")),
    ):
        obstacles = (Sphere("ball", ball, 0.1), floor.replace(position=[0, 0, 0.0 if ball[0] < 1 else 0.3]))
        distance, found = RAIL.clearance(np.zeros(4), obstacles)
        distances = {tuple(names[i] for i in p): d for d, p, _ in near(RAIL, np.zeros((1, 4)), obstacles)[0]}
        assert distances[pair] == pytest.approx(wanted, abs=1e-15)
        assert distance == min(distances.values())
        assert distances[tuple(names[i] for i in found)] == distance


def test_an_obstacle_that_a_body_ignores_is_not_measured():
    ball = Sphere("ball", [0.4, 0, 0.9], 0.1)
    assert RAIL.clearance(np.zeros(4), [ball])[0] < -0.1
    (row,) = near(RAIL, np.zeros((1, 4)), [ball.replace(ignored=("tip", "lower"))])
    assert {pair for _, pair, _ in row} == {(1, 4), *map(tuple, RAIL.bodies.pairs.tolist())}


@pytest.mark.parametrize("obstacles", [(), (Sphere("ball", [0, 0, 0], 1.0),)], ids=len)
def test_an_arm_without_bodies_meets_nothing(obstacles):
    distances, pairs = RAIL.replace(bodies=Bodies()).clearance(np.zeros((2, 4)), obstacles)
    assert (distances == np.inf).all()
    assert (pairs == -1).all()


def test_bad_input_is_refused():
    for q in (np.zeros(3), np.full(4, np.nan), "q", 0.0):
        with pytest.raises(InvalidInputError, match="q: expected"):
            RAIL.clearance(q)
    with pytest.raises(UnknownNameError, match="Did you mean 'tip'"):
        RAIL.clearance(np.zeros(4), [Sphere("ball", [0, 0, 0], 1.0, ignored=("tipp",))])


def test_plain_python_measures_the_same():
    code = (
        "import json, warnings; warnings.simplefilter('ignore')\n"
        "from tests.kernels.test_bodies import OBSTACLES, RAIL, near, postures\n"
        "print(json.dumps([[p, d, *g] for row in near(RAIL, postures(RAIL, 5)) for d, p, g in row]))"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    plain = json.loads(out.stdout)
    compiled = [[p, d, *g] for row in near(RAIL, postures(RAIL, 5)) for d, p, g in row]
    assert [tuple(pair) for pair, *_ in plain] == [pair for pair, *_ in compiled]
    np.testing.assert_allclose([row[1:] for row in plain], [row[1:] for row in compiled], rtol=0, atol=1e-14)
