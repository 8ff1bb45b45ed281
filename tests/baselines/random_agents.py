"""Agents with random weights, for tests."""

import itertools
import pathlib

import numpy as np

from baselines.agents.files import agent_of, save_agent
from baselines.agents.network import Network
from baselines.agents.processing import Held
from baselines.agents.track import Track
from baselines.policy import Problem

#: Times in [s], and the same as steps of 1 ms.
AHEAD, OFFSETS = (0.001, 0.002, 0.005, 0.02), (1, 2, 5, 20)


def network(sizes, activation="silu", squash="linear", *, zero=False, seed=0):
    """A network with outputs of about 1; with zero, outputs are 0."""
    rng = np.random.default_rng(seed)
    weights = [rng.normal(size=(o, i)) / np.sqrt(i) for i, o in itertools.pairwise(sizes)]
    biases = [rng.normal(0.0, 0.1, size=size) for size in sizes[1:]]
    if zero:
        weights[-1] *= 0.0
        biases[-1] *= 0.0
    return Network(tuple(weights), tuple(biases), activation, squash)


def random_agent(scenario, *, zero=False, hidden=(16, 9), seed=0, training=None, processing=None):
    """An agent in memory that fits a scenario."""
    processing, problem = processing or Track(AHEAD), Problem.of(scenario)
    sizes = (processing.size(problem), *hidden, processing.outputs(problem))
    return agent_of(network(sizes, zero=zero, seed=seed), processing, scenario, training)


def nothing_held(processing, problem, rows):
    """What is held before the first evaluation of a network."""
    return Held(np.zeros((rows, processing.held_size(problem))), np.zeros(rows, dtype=np.int64))


def write_agent(file, scenario, **options):
    """Writes an agent that fits a scenario, and returns its path as a text."""
    save_agent(pathlib.Path(file), random_agent(scenario, **options))
    return str(file)
