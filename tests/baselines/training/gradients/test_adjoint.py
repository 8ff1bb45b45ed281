"""The compiled segment is the environment, and its adjoint the gradient: by central differences in float64."""

import dataclasses

import numpy as np
import pytest

from baselines.agents.bilinear.features import mean_twists
from baselines.agents.bilinear.kernels import action_rows
from baselines.policy import Problem
from baselines.policy_kernels import Model
from baselines.training.gradients.adjoint import Gradient, adjoint
from baselines.training.gradients.segment import Path, Rows, segment
from ikgym import TrackingCost, arms, scenarios, tasks
from ikgym.rl.twists import twist_size
from ikgym.simulator import Simulator
from tests.comparison import identical

ARMS = ["varga7", "planar2", "khan8", "tiago"]  # a prismatic joint, the fewest joints, eight, a prismatic joint 1
ROWS, STEPS, DT = 4, 5, 0.01
#: Of G: such that some of the commands exceed the velocity limit of 1.
GAIN = 0.02


@dataclasses.dataclass
class Case:
    """Arms near a reference that goes past them, and the gradient of a number by all that a segment begins with."""

    task: Model
    rows: Rows
    start: list[np.ndarray]
    by_end: list[np.ndarray]

    @classmethod
    def of(cls, arm, kind, limited, cost, seed=0):
        rng = np.random.default_rng(seed)
        n, home = arm.joints, rng.uniform(-1.0, 1.0, arm.joints)
        ones = np.ones(n) if limited else np.full(n, np.inf)
        limits = np.array([home - 0.06 * ones, home + 0.06 * ones, 0.8 * ones, 0.5 * ones])
        task = Model(arm.chain, kind.kind, cost.parameters, DT, np.ones(n), limits)
        q = home + rng.uniform(-0.05, 0.05, (ROWS, n))
        way = home + np.cumsum(rng.normal(scale=0.02, size=(ROWS, STEPS, n)), 1)
        nominal = kind.coordinates(*arm.forward(way))
        count = np.array([STEPS, STEPS, STEPS - 2, 0])
        rows = Rows(nominal, rng.random((ROWS, STEPS)) < 0.7, count, rng.uniform(0.1, 1.0, ROWS))
        scale = np.tile([GAIN] * twist_size(kind.kind) + [0.5], n)
        output = scale * rng.normal(size=(ROWS, len(scale)))
        by_end = [rng.normal(size=ROWS), rng.normal(size=q.shape), rng.normal(size=q.shape)]
        return cls(task, rows, [q, rng.uniform(-0.5, 0.5, q.shape), output], by_end)

    def play(self, start):
        path = Path.empty(ROWS, STEPS, start[0].shape[1])
        path.q[:, 0], path.qdot[:, 0] = start[:2]
        segment(self.task, self.rows, start[2], path, 0, ROWS)
        return path

    def numbers(self, start):
        """One of each arm."""
        path = self.play(start)
        last = np.arange(ROWS), self.rows.steps
        by_cost, by_q, by_qdot = self.by_end
        return by_cost * path.cost + (by_q * path.q[last]).sum(1) + (by_qdot * path.qdot[last]).sum(1)

    def gradient(self):
        path = self.play(self.start)
        out = Gradient(self.by_end[1].copy(), self.by_end[2].copy(), np.full(self.start[2].shape, np.nan))
        adjoint(self.task, self.rows, self.start[2], path, self.by_end[0], out, 0, ROWS)
        return out

    def differences(self, part, step=1e-6):
        """The gradient of the numbers, each by the start of its arm."""
        out = np.zeros(self.start[part].shape)
        for column in range(out.shape[1]):
            for sign in (1.0, -1.0):
                moved = [array.copy() for array in self.start]
                moved[part][:, column] += sign * step
                out[:, column] += sign * self.numbers(moved) / (2.0 * step)
        return out

    def check(self):
        for part, given in enumerate(self.gradient()):
            wanted = self.differences(part)
            largest = np.abs(wanted).max(1, keepdims=True)
            assert (np.abs(given - wanted) <= 1e-6 * largest + 1e-9).all(), (part, given, wanted)


SMOOTH = TrackingCost(delta_x=0.03, p_x=3, delta_qdot=0.3, p_out=4, p_in=4)


#: All tasks with one arm, and all arms with one task, without limits and with them.
CASES = [
    *(("varga7", kind, True) for kind in tasks.names()),
    *((n, "pose", flag) for n in ARMS for flag in (False, True)),
]


@pytest.mark.parametrize(("name", "kind", "limited"), dict.fromkeys(CASES))
def test_gradients_by_all_that_a_segment_begins_with(name, kind, limited):
    Case.of(arms.get(name), tasks.get(kind), limited, SMOOTH).check()


def test_limits_are_met():
    """What the gradients above were tested at: stops, limits of velocity and acceleration, and none of them."""
    case = Case.of(arms.get("varga7"), tasks.get("pose"), True, SMOOTH)
    path = case.play(case.start)
    q, qdot = path.q[:2], path.qdot[:2]
    lower, upper, fastest, change = case.task.limits
    stopped = (q == lower) | (q == upper)
    moving = ~stopped[:, 1:]
    fast = moving & (np.abs(qdot[:, 1:]) == fastest)
    jerky = moving & np.isclose(np.abs(np.diff(qdot, axis=1)), change, rtol=1e-12)
    assert stopped.any()
    assert fast.any()
    assert jerky.any()
    assert (moving & ~fast & ~jerky).any()


@pytest.mark.parametrize("exponents", [(3.0, 4.0, 4.0), (2.0, 3.0, 1.5), (1.0, 2.0, 1.0)])
def test_gradients_of_costs_with_other_exponents(exponents):
    p_x, p_out, p_in = exponents
    cost = TrackingCost(delta_x=0.03, p_x=p_x, delta_qdot=0.3, p_out=p_out, p_in=p_in)
    Case.of(arms.get("planar2"), tasks.get("position"), False, cost).check()


def known(name):
    if name == "zhang6-axis":
        return scenarios.get("zhang6-lspb").replace(name=name, task=tasks.get("axis"))
    return scenarios.get(name)


@pytest.mark.parametrize(
    "name", ["varga7-random", "faitli3-stretched", "zhang6-axis", "khan8-q7q8", "panda-circle", "tiago-line"]
)
def test_a_segment_is_the_environment(name):
    """Step by step the same joint coordinates, velocities and costs as the agent's actions, within the same limits."""
    scenario, offsets = known(name).replace(steps=12, iterations_per_point=2), np.array([1, 7])
    simulator = Simulator(scenario, 1, tuple(offsets.tolist()))
    simulator.reset(np.ones(1, dtype=bool), [np.random.default_rng(3)])
    out, n = simulator.observe(), scenario.joints
    task = Problem.of(scenario.replace(model=scenario.arm)).kernel_model
    chain, w, counted = task.chain, twist_size(task.kind), scenario.counted()
    output = np.random.default_rng(1).normal(scale=2.0, size=(1, n * (w + 1)))
    for k in range(scenario.steps):
        action, path, ahead = np.empty((1, n)), Path.empty(1, 1, n), np.empty((1, w))
        scene = task.kind, chain, task.dt, offsets
        action_rows(scene, task.velocity_limit, out.q, out.pose, out.nominal, output, action)
        path.q[:, 0], path.qdot[:, 0] = out.q, out.qdot
        speed = np.array([mean_twists(task.kind, task.dt, offsets, out.nominal[0], np.empty(6), ahead)])
        rows = Rows(out.nominal[:, :1].copy(), counted[None, k + 1 : k + 2], np.ones(1, int), speed)
        segment(task, rows, output, path, 0, 1)
        out = simulator.step(action)
        np.testing.assert_allclose(path.q[:, 1], out.q, rtol=0, atol=1e-13)
        np.testing.assert_allclose(path.qdot[:, 1], out.qdot, rtol=1e-12, atol=1e-10)
        assert path.cost[0] == pytest.approx(out.tracking_cost[0] + out.velocity_cost[0], rel=1e-8)
        assert path.distance[0] == pytest.approx(out.position_error[0], rel=1e-9)


def test_rows_are_independent():
    """Shared out to threads, they give the same bit for bit."""
    case = Case.of(arms.get("varga7"), tasks.get("pose"), True, SMOOTH)
    whole, wanted = case.play(case.start), case.gradient()
    parts = Path.empty(ROWS, STEPS, 7)
    parts.q[:, 0], parts.qdot[:, 0] = case.start[:2]
    gradient = Gradient(case.by_end[1].copy(), case.by_end[2].copy(), np.empty(case.start[2].shape))
    for start, stop in ((2, 4), (0, 1), (1, 2)):
        segment(case.task, case.rows, case.start[2], parts, start, stop)
        adjoint(case.task, case.rows, case.start[2], parts, case.by_end[0], gradient, start, stop)
    last = np.arange(ROWS), case.rows.steps
    assert identical(parts.q[last], whole.q[last])
    assert identical(parts.cost, whole.cost)
    assert all(identical(given, right) for given, right in zip(gradient, wanted, strict=True))
