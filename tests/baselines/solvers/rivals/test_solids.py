"""Bodies and obstacles as other libraries see them, and what the rivals do with them."""

import coal
import mujoco
import numpy as np
import pinocchio as pin
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.policy import Problem
from baselines.solvers.rivals.model_files import geom_name, mjcf, urdf
from baselines.solvers.rivals.solids import geometry_model, solids_of
from ikgym.exceptions import InvalidInputError
from ikgym.obstacles import Capsule, HalfSpace, Sphere
from tests.arms.drawing import postures
from tests.baselines.making import circle, made

#: A sphere and a capsule next to a circle's boxes, and a wall that is askew.
OTHERS = (
    Sphere("ball", [0.3, 0.6, 0.9], 0.1),
    Capsule("bar", [0.5, -0.6, 0.2], [0.6, -0.7, 0.5], 0.05, ignored=["hand"]),
    HalfSpace("wall", [-0.7, 0.0, 0.0], [1.0, 0.2, 0.1]),
)


def shelf():
    scenario = ikgym.scenarios.get("panda-shelf")
    return scenario.replace(obstacles=(*scenario.obstacles, *OTHERS))


def test_pairs_are_those_of_the_bodies_and_of_the_obstacles_that_are_checked():
    scenario = shelf()
    solids, bodies = solids_of(Problem.of(scenario)), scenario.arm.bodies
    moving = sum(link > 0 for link in bodies.links)
    assert len(solids.pairs) == len(bodies.pairs) + moving * len(scenario.obstacles) - 1
    bar = len(bodies) + scenario.surroundings.boxes[:, 9].tolist().index(0.55)
    assert (bodies.names.index("hand"), bar) not in solids.pairs
    assert solids_of(Problem.of(circle())).each == ()


def pinocchio_measures(text, solids, names=None):
    """A function of q that measures the clearance in [m] by coal: between solids, or those that the URDF has."""
    model = pin.buildModelFromXML(text)
    geometry = pin.buildGeomFromUrdfString(model, text, pin.COLLISION) if names else geometry_model(solids, pin, coal)
    for pair in solids.pairs if names else ():
        geometry.addCollisionPair(pin.CollisionPair(*[geometry.getGeometryId(names[i]) for i in pair]))
    data, measured = model.createData(), geometry.createData()

    def measure(q):
        pin.computeDistances(model, data, geometry, measured, q)
        return min(one.min_distance for one in measured.distanceResults)

    return measure


def mujoco_measures(text, solids):
    """The same by MuJoCo."""
    model = mujoco.MjModel.from_xml_string(text)
    data, points = mujoco.MjData(model), np.empty(6)
    numbers = [[model.geom(geom_name(i)).id for i in pair] for pair in solids.pairs]

    def measure(q):
        data.qpos = q
        mujoco.mj_kinematics(model, data)
        return min(mujoco.mj_geomDistance(model, data, *pair, 10.0, points) for pair in numbers)

    return measure


def test_coal_mujoco_and_a_urdf_measure_the_clearance_of_the_arm():
    scenario = shelf()
    arm, solids = scenario.arm, solids_of(Problem.of(scenario))
    names = [f"{geom_name(i)}_0" for i in range(len(solids.each))]  # Pinocchio numbers the geometries of a link
    measures = [
        pinocchio_measures(urdf(arm), solids),
        pinocchio_measures(urdf(arm, solids), solids, names),
        mujoco_measures(mjcf(arm, solids), solids),
    ]
    each = [(q, float(arm.clearance(q, scenario.obstacles)[0])) for q in postures(arm, 50)]
    clear = [pair for pair in each if pair[1] > 0.0]  # what is measured inside of each other differs
    assert len(clear) > 10
    for q, distance in clear:
        assert [measure(q) for measure in measures] == pytest.approx([distance] * 3, abs=1e-9)


@pytest.mark.parametrize("name", ["pink", "mink", "roboplan"])
def test_a_wall_in_the_way_is_not_touched(name):
    """It lies across the way of the tool, half of which is behind it."""
    free = circle("panda-hand", acceleration_limit=np.full(7, np.inf))  # mink knows none
    way = np.diff(free.nominal(0)[[0, -1], -3:], axis=0)[0]
    wall = HalfSpace("wall", free.nominal(0)[0, -3:], -way)
    room = 0.5 - free.arm.clearance(free.start, (wall,))[0] / np.linalg.norm(way)
    scenario = free.replace(obstacles=(wall.replace(position=wall.position + room * way),), steps=320)
    policy = made(name, scenario)
    kept = rollout(scenario, policy, 0)
    assert not kept.stopped.any()
    assert 0.9 * policy.clearance < kept.clearance.min() < 2.0 * policy.clearance
    assert rollout(scenario, baselines.make("dls", scenario), 0).stopped.any()


@pytest.mark.parametrize("name", ["pink", "mink", "roboplan"])
def test_obstacles_that_move_are_refused(name):
    made(name, circle())
    with pytest.raises(InvalidInputError, match=f"{name}: expected obstacles at rest"):
        baselines.make(name, ikgym.scenarios.get("panda-person"))
