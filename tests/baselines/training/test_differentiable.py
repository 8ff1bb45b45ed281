"""What PyTorch differentiates is the environment: the same numbers, and their true gradients."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import baselines
from baselines.agents.features import Processing
from baselines.policy import Batch, Problem
from baselines.training.trainers.differentiable_arm import DifferentiableArm
from baselines.training.trainers.differentiable_policy import DifferentiablePolicy
from ikgym import scenarios, tasks
from ikgym.exceptions import InvalidInputError
from ikgym.plant import Plant
from ikgym.simulator import Simulator

OFFSETS = (1, 2, 7, 20)
AXIS = scenarios.get("zhang6-lspb").replace(name="zhang6-axis", task=tasks.get("axis"))
NAMES = ["varga7-random", "faitli3-stretched", "zhang6-lspb", "khan8-q7q8", AXIS.name]
ROWS = 5


def known(name):
    return AXIS if name == AXIS.name else scenarios.get(name)


def place(scenario, seed=0):
    """Arms near their nominal trajectory, and what they are shown."""
    rng = np.random.default_rng(seed)
    nominal = scenario.nominal(seed, OFFSETS[-1])
    steps = rng.integers(0, scenario.steps, ROWS)
    path = scenario.nominal_joint_path(seed)
    home = np.tile(scenario.start, (ROWS, 1)) if path is None else path[steps]
    q = home + rng.normal(scale=0.02, size=(ROWS, scenario.joints))
    qdot = rng.normal(size=q.shape)
    shown = nominal[steps[:, None] + np.array(OFFSETS)]
    return torch.from_numpy(q).requires_grad_(), torch.from_numpy(qdot).requires_grad_(), shown, rng


def differences(function, point, step=1e-6):
    """The gradient of a number by a tensor, by central differences."""
    out = np.zeros(point.shape)
    for index in np.ndindex(*point.shape):
        values = []
        for sign in (1.0, -1.0):
            moved = point.detach().clone()
            moved[index] += sign * step
            values.append(function(moved).item())
        out[index] = (values[0] - values[1]) / (2.0 * step)
    return out


def batch_of(scenario, q, qdot, shown, remaining):
    numbers = q.detach().numpy(), qdot.detach().numpy()
    pose = scenario.task.coordinates(*scenario.arm.forward(numbers[0]))
    return Batch(*numbers, pose, shown, remaining)


@pytest.mark.parametrize("name", NAMES)
def test_errors_and_their_gradients(name):
    scenario = known(name)
    q, _, shown, rng = place(scenario)
    arm, nominal = DifferentiableArm(scenario), shown[:, 0]
    error = arm.error(q, nominal)
    pose = scenario.task.coordinates(*scenario.arm.forward(q.detach().numpy()))
    np.testing.assert_allclose(error.detach().numpy(), scenario.task.error(nominal, pose), atol=1e-12)
    weights = torch.from_numpy(rng.normal(size=tuple(error.shape)))
    (error * weights).sum().backward()
    np.testing.assert_allclose(q.grad, differences(lambda q: (arm.error(q, nominal) * weights).sum(), q), atol=1e-7)


def limited(name):
    """The scenario with limits that random actions run into."""
    scenario = known(name)
    q, speed = scenario.nominal_joint_path(0)[0], scenario.velocity_limit
    way = 2.0 * scenario.dt * speed
    limits = {"lower": q - way, "upper": q + way, "velocity_limit": 0.8 * speed, "acceleration_limit": 3e2 * speed}
    return scenario.replace(arm=scenario.arm.replace(**limits), start=q)


@pytest.mark.parametrize("make", [known, limited])
@pytest.mark.parametrize("name", NAMES)
def test_steps_and_costs_are_those_of_the_environment(name, make):
    if make is limited and known(name).nominal_joint_path(0) is None:
        pytest.skip("no joint path to put limits around")
    scenario = make(name).replace(steps=12, iterations_per_point=1)
    rng, arm = np.random.default_rng(0), DifferentiableArm(scenario)
    simulator = Simulator(scenario, 1, 1)
    simulator.reset(np.ones(1, dtype=bool), [np.random.default_rng(3)])
    out = simulator.observe()
    q, qdot = torch.from_numpy(out.q.copy()), torch.from_numpy(out.qdot.copy())
    held = np.zeros(3)
    for _ in range(12):
        nominal = out.nominal[:, 0].copy()
        action = rng.uniform(-1.3, 1.3, out.q.shape)
        out = simulator.step(action)
        q, qdot = arm.step(q, qdot, torch.from_numpy(action))
        held += out.at_limit[0]
        np.testing.assert_allclose(q.numpy(), out.q, rtol=0, atol=1e-14)
        cost = arm.stage_cost(arm.error(q, nominal), qdot)
        np.testing.assert_allclose(cost.numpy(), out.tracking_cost + out.velocity_cost, rtol=1e-11)
    assert (held > 0).all() == scenario.arm.limited


@pytest.mark.parametrize("exponents", [(3.0, 4.0, 4.0), (2.0, 3.0, 1.5), (1.0, 2.0, 1.0)])
def test_gradients_of_costs(exponents):
    p_x, p_out, p_in = exponents
    scenario = scenarios.get("varga7-random")
    cost = scenario.cost.replace(p_x=p_x, p_out=p_out, p_in=p_in)
    arm = DifferentiableArm(scenario.replace(cost=cost))
    rng = np.random.default_rng(0)
    error = torch.from_numpy(rng.normal(scale=2e-3, size=(50, 6))).requires_grad_()
    qdot = torch.from_numpy(rng.normal(size=(50, 7))).requires_grad_()
    arm.stage_cost(error, qdot).sum().backward()
    np.testing.assert_allclose(error.grad, cost.tracking_gradient(error.detach().numpy()), rtol=1e-11)
    np.testing.assert_allclose(qdot.grad, cost.velocity_gradient(qdot.detach().numpy()), rtol=1e-11)


@pytest.mark.parametrize("null_space", [None, 1e-2])
@pytest.mark.parametrize("name", NAMES)
def test_features_and_actions_are_those_of_the_processing(name, null_space):
    scenario = known(name)
    q, qdot, shown, rng = place(scenario)
    problem, arm = Problem.of(scenario), DifferentiableArm(scenario)
    remaining = rng.integers(0, 40, (ROWS, 1)).astype(float)
    base = rng.uniform(-0.2, 0.2, q.shape)
    answer = rng.normal(size=q.shape).astype(np.float32)
    batch = batch_of(scenario, q, qdot, shown, remaining)
    for base_policy, under in ((None, None), ("dls", base)):
        processing = Processing(OFFSETS, 2.0, base_policy, null_space)
        tensor = None if under is None else torch.from_numpy(under)
        features, speed = arm.features(processing, q, qdot, shown, remaining, tensor)
        np.testing.assert_allclose(features.detach().numpy(), processing.features(problem, batch, under), atol=2e-6)
        action = arm.action(processing, q, speed, torch.from_numpy(answer), tensor)
        np.testing.assert_allclose(
            action.detach().numpy(), processing.action(problem, batch, answer, under), atol=1e-12
        )


@pytest.mark.parametrize("name", NAMES)
def test_gradients_of_features_and_actions(name):
    scenario = known(name)
    q, qdot, shown, rng = place(scenario)
    arm, remaining = DifferentiableArm(scenario), np.full((ROWS, 1), 3.0)
    processing = Processing(OFFSETS, 2.0, "dls", 1e-2)
    base = torch.from_numpy(rng.uniform(-0.2, 0.2, tuple(q.shape))).requires_grad_()
    answer = torch.from_numpy(rng.uniform(-0.9, 0.9, tuple(q.shape))).requires_grad_()
    weights = torch.from_numpy(rng.normal(size=(ROWS, 200)))

    def number(q, qdot, base, answer):
        features, speed = arm.features(processing, q, qdot, shown, remaining, base)
        action = arm.action(processing, q, speed, answer, base)
        return (torch.cat([features, action], 1) * weights[:, : features.shape[1] + action.shape[1]]).sum()

    point = [q, qdot, base, answer]
    number(*point).backward()
    for at, tensor in enumerate(point):
        wanted = differences(lambda moved, at=at: number(*point[:at], moved, *point[at + 1 :]), tensor)
        # The projector is differentiated by differences, which are not central.
        np.testing.assert_allclose(tensor.grad, wanted, rtol=1e-3, atol=2e-3)


@pytest.mark.parametrize("policy", ["dls", "full_orientation", "null_space", "mfac"])
def test_gradients_of_base_policies(policy):
    scenario = scenarios.get("varga7-random")
    _, qdot, _, rng = place(scenario)
    made = baselines.make(policy, scenario)
    shown = max(1, made.preview)
    nominal, remaining = (
        np.stack([scenario.nominal(i, 40)[1 : 1 + shown] for i in range(ROWS)]),
        np.full((ROWS, 1), 9.0),
    )
    start = torch.from_numpy(np.stack([scenario.nominal_joint_path(i)[0] for i in range(ROWS)]) + 1e-3).requires_grad_()
    under, memory = DifferentiablePolicy(made, scenario.arm), made.memory(ROWS)
    action, after = under(start, qdot, nominal, remaining, memory, with_gradient=True)
    alone, kept = under(start, qdot, nominal, remaining, memory, with_gradient=False)
    np.testing.assert_array_equal(action.detach(), alone)
    for one, other in zip(after, kept, strict=True):
        np.testing.assert_array_equal(one, other)
    weights = torch.from_numpy(rng.normal(size=tuple(action.shape)))
    (action * weights).sum().backward()

    def number(q):
        return (under(q, qdot, nominal, remaining, memory, with_gradient=False)[0] * weights).sum()

    wanted = differences(number, start, step=1e-4)
    np.testing.assert_allclose(start.grad, wanted, rtol=0.02, atol=0.02 * np.abs(wanted).max())


def test_scenarios_that_cannot_be_differentiated_are_refused():
    with pytest.raises(InvalidInputError, match="ideal plant"):
        DifferentiableArm(scenarios.get("varga7-random").replace(plant=Plant(noise=0.1)))
    with pytest.raises(InvalidInputError, match="first pose"):
        DifferentiableArm(scenarios.get("zhang3-helix"))


def test_tasks_are_all_covered():
    assert {known(name).task.name for name in NAMES} == set(tasks.names())
