"""Agents whose velocities are in units of what is asked for: their law, and what files hold of it."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from baselines.agents.bilinear.processing import held
from baselines.agents.network import Network
from baselines.agents.relative.processing import Relative
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.agents.bilinear.test_bilinear import OFFSETS, batch_of, problem_of


def random_network(processing, problem):
    rng, sizes = np.random.default_rng(3), (processing.size(problem), 16, processing.outputs(problem))
    weights = tuple(rng.normal(size=(b, a)) for a, b in itertools.pairwise(sizes))
    return Network(weights, tuple(rng.normal(size=b) for b in sizes[1:]), "tanh", "linear")


@pytest.mark.parametrize(("arm", "task"), [("varga7", "pose"), ("tiago", "axis"), ("varga7", "position")])
@pytest.mark.parametrize(("bilinear", "damping"), [(False, None), (True, None), (True, 1e-2)])
@pytest.mark.parametrize("squash", ["clip", "tanh"])
def test_one_call_is_the_three_parts(arm, task, bilinear, damping, squash):
    problem = problem_of(arm, task)
    processing = Relative(OFFSETS, 5.0, 2.0, gain=0.5, squash=squash, bilinear=bilinear, damping=damping)
    network, batch = random_network(processing, problem), batch_of(problem)
    features = processing.features(problem, batch)
    parts = processing.action(problem, batch, network.forward(features))
    assert np.array_equal(processing.law(problem, batch, network), parts)
    n, w = problem.model.joints, 3 if task == "position" else 6
    said = network.forward(features).astype(np.float64)
    if damping is not None:
        said = held(problem, damping, batch.q, network.forward(features))
    if bilinear:
        rows = said.reshape(-1, n, w + 1)
        due = np.column_stack([features[:, :w], features[:, w] / 0.2])
        said = (rows * due[:, None]).sum(axis=2)
    said = np.clip(0.5 * said, -2.0, 2.0) if squash == "clip" else 2.0 * np.tanh(0.5 * said / 2.0)
    unit = parts * problem.velocity_limit / said
    assert np.allclose(unit, unit[:, :1], rtol=1e-5)  # in float32
    assert (unit > 0.0).all()


def test_files_hold_all_of_it():
    processing = Relative(OFFSETS, 5.0, squash="tanh", bilinear=True)
    assert "damping" not in processing.to_json()  # as files of before
    damped = dataclasses.replace(processing, damping=1e-3)
    assert Relative.from_json(damped.to_json()) == damped != processing
    assert Relative.from_json(processing.to_json()) == processing
    assert Relative.from_json(processing.to_json() | {"gain": 0.5}) != processing
    with pytest.raises(UnknownNameError, match="gains"):
        Relative.from_json(processing.to_json() | {"gains": 0.5})


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"offsets": (1,)}, "at least two"),
        ({"offsets": (2, 1)}, "offsets|preview"),
        ({"furthest": 0.0}, "furthest"),
        ({"largest": float("nan")}, "largest"),
        ({"gain": -1.0}, "gain"),
        ({"squash": "sigmoid"}, "squash"),
        ({"bilinear": 1}, "true or false"),
        ({"damping": 0.1}, "damping: expected None unless bilinear"),
        ({"bilinear": True, "damping": 0.0}, "damping"),
    ],
)
def test_wrong_values_are_refused(wrong, said):
    with pytest.raises((InvalidInputError, UnknownNameError), match=said):
        dataclasses.replace(Relative(OFFSETS, 5.0), **wrong)
