"""Bilinear agents keep to the limits of their arm, as `qp` does."""

import itertools

import numpy as np

from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.files import agent_of
from baselines.agents.network import Network
from baselines.agents.policy import Agent, keep_rows
from baselines.episodes import rollouts
from baselines.policy import Problem
from baselines.solvers.quadratic_program.velocity_box import velocity_box
from ikgym import scenarios, tasks

PANDA = scenarios.get("panda-random").replace(task=tasks.get("pose"), steps=300)


def test_actions_are_kept_within_the_velocity_box():
    """Those outside come to its edge, those inside stay as they are, and what is no number stays none."""
    problem, rng = Problem.of(PANDA), np.random.default_rng(0)
    arm, limits = problem.model, problem.limits
    q = rng.uniform(arm.lower, arm.upper, (200, 7))
    last = rng.uniform(-0.3, 0.3, (200, 7))
    asked = rng.uniform(-1.2, 1.2, (200, 7))
    asked[0, 3] = np.nan
    lower, upper, kept = np.empty(7), np.empty(7), asked.copy()
    keep_rows(limits, problem.dt, problem.velocity_limit, q, last, kept)
    for row in range(200):
        velocity_box(limits, problem.dt, q[row], last[row], lower, upper)
        wanted = np.clip(asked[row] * problem.velocity_limit, lower, upper)
        np.testing.assert_allclose(kept[row] * problem.velocity_limit, wanted, rtol=1e-14)
        inside = wanted == asked[row] * problem.velocity_limit
        assert np.array_equal(kept[row, inside], asked[row, inside])
    assert np.isnan(kept[0, 3])


def pushing():
    """An agent that pushes joints against their stops as fast as it can."""
    processing, problem = Bilinear((1, 10, 40), 1e-3), Problem.of(PANDA)
    sizes = processing.size(problem), 8, processing.outputs(problem)
    rng = np.random.default_rng(1)
    weights = tuple(rng.normal(size=(b, a)) for a, b in itertools.pairwise(sizes))
    network = Network(weights, (np.zeros(8), rng.normal(scale=9.0, size=sizes[2])), "silu", "linear")
    return Agent(problem, given=agent_of(network, processing, PANDA))


def test_no_limit_holds_an_agent_back():
    policy = pushing()
    episodes = rollouts(PANDA, policy, [1, 2])
    assert not any(episode.at_limit.any() for episode in episodes)
    object.__setattr__(policy, "limits", None)
    held_back = sum(episode.at_limit for episode in rollouts(PANDA, policy, [1, 2])).sum(axis=0)
    assert held_back[0] > 0  # by stops
