"""The whole law of the bilinear actor in one call is its three parts, bit for bit."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.network import Network
from tests.baselines.agents.bilinear.test_bilinear import OFFSETS, batch_of, problem_of


@pytest.mark.parametrize(
    "inverse",
    [{}, {"damping": 1e-3}, {"damping": 1e-3, "matrix": False}, {"damping": 1e-3, "predicted_rates": True}],
    ids=str,
)
@pytest.mark.parametrize(("arm", "task"), [("varga7", "pose"), ("tiago", "axis"), ("varga7", "position")])
def test_one_call_is_the_three_parts(arm, task, inverse):
    problem, processing = problem_of(arm, task), Bilinear(OFFSETS, **inverse)
    batch, rng = batch_of(problem), np.random.default_rng(3)
    sizes = processing.size(problem), 16, processing.outputs(problem)
    network = Network(
        tuple(rng.normal(size=(b, a)) for a, b in itertools.pairwise(sizes)),
        tuple(rng.normal(size=b) for b in sizes[1:]),
        "silu",
        "linear",
    )
    parts = processing.action(problem, batch, network.forward(processing.features(problem, batch)))
    assert np.array_equal(processing.law(problem, batch, network), parts)
    assert np.ptp(parts) > 0.0
