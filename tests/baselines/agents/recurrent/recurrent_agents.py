"""Agents with memory whose weights are drawn or chosen."""

import numpy as np

import ikgym
from baselines.agents.files import agent_of
from baselines.agents.recurrent.kernels import MOST
from baselines.agents.recurrent.network import GatedNetwork, shapes
from baselines.agents.recurrent.policy import RecurrentPolicy
from baselines.agents.recurrent.processing import Recurrent
from baselines.policy import Problem

#: A base policy whose step takes no time.
PROCESSING = Recurrent("dls:damping=1e-2", gap=1)
SIZES = Recurrent.sizes((4, 3))


def drawn(seed=0, sizes=SIZES):
    """A network with any weights."""
    rng = np.random.default_rng(seed)
    return GatedNetwork(
        sizes, {k: rng.normal(0.0, 0.5, shape).astype(np.float32) for k, shape in shapes(sizes).items()}
    )


def constant(outputs):
    """A network with constant outputs: multiples of the standard deviations at an output of 0."""
    zeros = {name: np.zeros(shape, np.float32) for name, shape in shapes(SIZES).items()}
    bias = MOST * np.arctanh(np.log(outputs) / MOST)
    return GatedNetwork(SIZES, {**zeros, "head.bias": bias.astype(np.float32)})


def made(network=None, scenario="panda-camera-slow", processing=PROCESSING, **options):
    """A policy with such a network."""
    on = ikgym.scenarios.get(scenario) if isinstance(scenario, str) else scenario
    file = agent_of(drawn() if network is None else network, processing, ikgym.scenarios.get("panda-field"))
    return RecurrentPolicy(Problem.of(on), given=file, **options)
