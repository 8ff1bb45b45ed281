"""Horizons for the tests of the kernels."""

import numpy as np

import ikgym
from baselines.policy import Problem
from baselines.solvers.receding_horizon.horizon import HorizonModel, analytic_gradient
from baselines.solvers.receding_horizon.task_constraints import Unknowns, kinematic_errors, task_system
from ikgym.validation import read_only


def joint_weights(joints):
    """Weights of the joints, all of them different."""
    return read_only(np.linspace(1.0, 3.0, joints))


def data_of(problem):
    """Of a scenario or a problem, with weights of the joints."""
    problem = Problem(problem.model, problem.task, problem.cost, problem.dt, problem.velocity_limit)
    return HorizonModel(problem.kernel_model, joint_weights(problem.model.joints))


def horizon_cost(data, q, nominal, qdot):
    return analytic_gradient(data, q, nominal, qdot, np.empty_like(qdot))


def constraints(dt, stages, n):
    """A: c(i) = (q(i+1) - q(i))/Δt - q̇(i) by (q(2 … HL), q̇(1 … HL-1)); q(1) is no variable."""
    rise = (np.eye(stages) - np.eye(stages, k=-1)) / dt
    return np.kron(np.hstack([rise, -np.eye(stages)]), np.eye(n))


def trapezoidal_weights(at):
    """The trapezoidal rule written out: the error of each step lies between those of the knots around it."""
    weights, before = np.zeros(len(at)), 0
    for k, here in enumerate(at):
        for step in range(before + 1, here + 1):
            share = (step - before) / (here - before)
            weights[k] += share
            if k > 0:
                weights[k - 1] += 1.0 - share
        before = here
    return weights


def reduced_by_hand(a, full):
    """Eq. 3-4: a gradient without its part across the constraints a, and their multipliers, by least squares."""
    multipliers = np.linalg.lstsq(a.T, -full, rcond=None)[0]
    return full + a.T @ multipliers, multipliers


def problem(name, stages):
    """A horizon off the nominal path, and its kernels' arguments."""
    scenario = ikgym.scenarios.get(name)
    rng = np.random.default_rng(stages)
    q = rng.uniform(-1, 1, scenario.joints)
    path = q + rng.uniform(-5e-3, 5e-3, (stages, scenario.joints))
    nominal = scenario.task.coordinates(*scenario.model.forward(path))
    return scenario, q, nominal, rng.uniform(-2, 2, (stages, scenario.joints))


def with_tasks(scenario, q, nominal, qdot):
    """The unknowns on the constraints, a system and arrays for the gradient."""
    data, e = data_of(scenario), scenario.task.error_size
    x = Unknowns(np.empty((len(qdot), e)), q + scenario.dt * np.cumsum(qdot, axis=0), qdot.copy())
    kinematic_errors(data, nominal, x.q, x.errors)
    return data, x, task_system(len(qdot), e, scenario.joints), Unknowns(*map(np.empty_like, x))
