"""Agents with random numbers in them, for tests."""

from __future__ import annotations

import itertools

import numpy as np

from baselines.agents.features import Processing
from baselines.agents.files import save_agent
from baselines.agents.network import Network
from baselines.policy import Problem

OFFSETS = (1, 2, 5, 20)


def network(sizes, activation="silu", squash="clip", *, zero=False, seed=0):
    """A network whose answers fill the box; with zero, one that answers zero."""
    rng = np.random.default_rng(seed)
    weights = [rng.normal(size=(o, i)) / np.sqrt(i) for i, o in itertools.pairwise(sizes)]
    biases = [rng.normal(0.0, 0.1, size=size) for size in sizes[1:]]
    if zero:
        weights[-1] *= 0.0
        biases[-1] *= 0.0
    return Network(tuple(weights), tuple(biases), activation, squash)


def write_agent(
    file,
    scenario,
    base_policy=None,
    *,
    zero=False,
    hidden=(16, 9),
    seed=0,
    offsets=OFFSETS,
    null_space=None,
    training=None,
):
    """Writes an agent that suits a scenario, and gives its path as a text."""
    processing = Processing(offsets=offsets, base_policy=base_policy, null_space=null_space)
    sizes = (processing.size(Problem.of(scenario)), *hidden, scenario.joints)
    save_agent(file, network(sizes, zero=zero, seed=seed), processing, scenario, training)
    return str(file)
