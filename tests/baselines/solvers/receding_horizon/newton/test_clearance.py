"""Clearance as a limit of the interior point method: its derivatives, and its optima against IPOPT's."""

import casadi
import numpy as np
import pytest

import ikgym
from baselines.policy import Problem
from baselines.policy.problem import sweep_bodies
from baselines.solvers.receding_horizon.newton.barrier import ANEW, Barrier, linearise, merit
from baselines.solvers.receding_horizon.newton.bodies import INFLUENCE, Clearance, clearance_workspace
from baselines.solvers.receding_horizon.newton.clearance import is_clear, keep_clear
from baselines.solvers.receding_horizon.newton.interior_point import minimise_limited
from baselines.solvers.receding_horizon.newton.minimise import CONVERGED, NewtonSettings
from baselines.solvers.receding_horizon.newton.workspace import newton_workspace
from ikgym.arms.bodies import Bodies
from ikgym.obstacles import HalfSpace, Sphere
from tests.baselines.solvers.receding_horizon.newton.states import (
    DT,
    State,
    horizon_of,
    path_problem,
    solved,
)
from tests.baselines.solvers.receding_horizon.newton.test_cost import differences
from tests.independent import casadi_kinematics
from tests.independent.casadi_horizon import CasadiHorizon

MARGIN = 1e-3
AT = (1, 2, 4, 8, 15, 25)
# Two spheres: one at the elbow, one at the hand.
BODIES = Bodies(("elbow", "hand"), (3, 7), [[0.0825, 0.0, 0.0], [0.0, 0.0, -0.1]], radii=[0.06, 0.05])


def around(arm, obstacles):
    """The clearance of an arm from obstacles, as the kernels see it."""
    boxes, checked = arm.bodies.surroundings(obstacles)
    return Clearance(arm.bodies.shapes, boxes[None], checked, sweep_bodies(arm), MARGIN, MARGIN + INFLUENCE)


def obstructed():
    """A Panda that moves its elbow and its hand, a sphere where the elbow goes, and a floor below the hand."""
    arm = ikgym.arms.get("panda").replace(bodies=BODIES)
    velocity = np.array([0.6, 0.4, -0.5, 0.2, 0.3, -0.2, 0.1])
    state = State(arm.home, velocity, np.array([arm.home, velocity, np.zeros(7), np.zeros(7)]))
    end = arm.home + DT * AT[-1] * velocity
    move = point(arm, end, 0) - point(arm, arm.home, 0)
    ahead = move / np.linalg.norm(move)

    ball = Sphere("ball", point(arm, end, 0) + (0.06 + 0.05 - 2.0 * MARGIN) * ahead, 0.05)
    floor = HalfSpace("floor", point(arm, end, 1) - [0.0, 0.0, 0.05 + 0.5 * MARGIN], [0.0, 0.0, 1.0])
    return arm, state, (ball, floor)


def part_of(arm, body):
    """The arm up to the link of a sphere, whose tool is its centre."""
    link, centre = arm.bodies.links[body], arm.bodies.starts[body]
    return ikgym.Arm("part", arm.offsets[:link], arm.axes[:link], arm.prismatic[:link], tool=centre)


def point(arm, q, body):
    """The centre of a sphere."""
    part = part_of(arm, body)
    return part.forward(q[: part.joints])[1]


def posed(arm, state, obstacles, at=AT):
    """The horizon of a state among obstacles, as NumPy and as the kernels see it."""
    problem = Problem(arm, ikgym.tasks.get("pose"), ikgym.TrackingCost(), DT, arm.velocity_limit)
    horizon = horizon_of(problem, state, at=at)
    return problem, horizon, path_problem(problem, horizon)._replace(clearance=around(arm, obstacles))


def workspace_of(here, path):
    """The workspace for a path."""
    return newton_workspace(here.data.kind, here.nominal.shape[1], *path.shape, True, here.clearance)


def test_gradient_is_that_of_central_differences():
    arm, state, obstacles = obstructed()
    _, _, here = posed(arm, state, obstacles)
    path = state.q + DT * np.array(AT)[:, None] * state.qdot
    workspace, barrier = workspace_of(here, path), Barrier(1e-2, 1.0)
    value = linearise(here, path, barrier, ANEW, False, workspace)
    assert value == pytest.approx(merit(here, path, barrier, workspace), rel=1e-12)
    assert value > linearise(here._replace(clearance=None), path, barrier, ANEW, False, workspace) + 1.0
    linearise(here, path, barrier, ANEW, False, workspace)
    gradient = workspace.model.gradient.ravel().copy()
    central = differences(lambda x: merit(here, x, barrier, workspace), path, 1e-7)
    np.testing.assert_allclose(gradient, central, rtol=1e-5, atol=1e-6 * abs(gradient).max())


def test_optimum_among_bodies_is_ipopts():
    arm, state, (ball, floor) = obstructed()
    problem, horizon, here = posed(arm, state, (ball, floor))

    class Among(CasadiHorizon):
        def _room(self, start, y, h, before):
            out = super()._room(start, y, h, before)
            for k in range(self.knots):
                q = start + DT * y[:, k]
                for body, radius in enumerate(arm.bodies.radii):
                    part = part_of(arm, body)
                    _, centre = casadi_kinematics.forward(part, q)
                    far = casadi.norm_2(centre - casadi.DM(ball.position)) - ball.radius
                    out += [1e3 * (far - radius - MARGIN), 1e3 * (centre[2] - floor.position[2] - radius - MARGIN)]
            return out

    best = Among(problem, len(AT), limited=True, braking=True).solve(horizon)
    path = np.tile(horizon.q, (len(AT), 1))
    minimum = minimise_limited(here, path, NewtonSettings(True, 300, 1e-8), 0.0, workspace_of(here, path))
    free, _ = solved(problem, horizon)
    assert best.converged
    assert minimum.outcome == CONVERGED
    assert minimum.cost == pytest.approx(best.cost, rel=1e-6)
    np.testing.assert_allclose(path, best.q, atol=1e-6)
    for obstacle in (ball, floor):
        assert arm.clearance(path, [obstacle])[0].min() == pytest.approx(MARGIN, abs=1e-7)
    assert free.cost < 0.9 * minimum.cost


def test_a_first_step_that_would_touch_is_slowed_down():
    """It goes on at half of the speed, or a quarter, until it is clear; without a way out the arm brakes."""
    arm, state, obstacles = obstructed()
    _, _, here = posed(arm, state, obstacles)
    here = here._replace(start=state.q + DT * AT[-1] * state.qdot, change_limit=np.full(7, np.inf))
    while arm.clearance(here.start, obstacles)[0] < 5e-4:
        here = here._replace(start=here.start - 1e-4 * state.qdot)
    work = workspace_of(here, here.start[None]).clearance
    chain, slow, fast = here.data.chain, 0.01 * state.qdot, 20.0 * state.qdot
    assert is_clear(here.clearance, chain, here.start, slow, DT, work)
    assert not is_clear(here.clearance, chain, here.start, fast, DT, work)
    kept, slower = slow.copy(), fast.copy()
    assert keep_clear(here.clearance, here, kept, work)
    np.testing.assert_array_equal(kept, slow)
    assert not keep_clear(here.clearance, here, slower, work)
    np.testing.assert_allclose(slower / fast, slower[0] / fast[0])
    assert 0.0 <= slower[0] / fast[0] < 1.0
    assert arm.clearance(here.start + DT * slower, obstacles)[0] > 0.0
    weak = here._replace(change_limit=np.full(7, 1e-3), qdot_before=fast)
    held = fast.copy()
    assert not keep_clear(weak.clearance, weak, held, work)
    np.testing.assert_allclose(held, fast - 1e-3 * np.sign(fast))


def test_what_passes_through_between_two_ends_is_not_clear():
    """A step over a thin obstacle, clear at both of its ends."""
    arm = ikgym.Arm("slider", np.zeros((1, 3)), [[1.0, 0.0, 0.0]], (True,))
    arm = arm.replace(bodies=Bodies(("ball",), (1,), [[0.0, 0.0, 0.0]], radii=[0.01]))
    clearance = around(arm, [Sphere("bead", [0.05, 0.0, 0.0], 0.001)])
    work = clearance_workspace(clearance, 1, 1)
    assert not is_clear(clearance, arm.chain, np.zeros(1), np.full(1, 100.0), 1e-3, work)
    assert is_clear(clearance, arm.chain, np.zeros(1), np.full(1, 30.0), 1e-3, work)
    assert is_clear(clearance, arm.chain, np.zeros(1), np.full(1, -1000.0), 1e-3, work)
