"""Networks of agents: the forward pass and its checks."""

import copy
import pickle

import numpy as np
import pytest

from baselines.agents.network import ACTIVATIONS, SQUASHES, Network
from ikgym.exceptions import InvalidInputError
from tests.baselines.random_agents import network
from tests.comparison import identical

FORMULAS = {
    "relu": lambda x: np.maximum(x, 0.0),
    "tanh": np.tanh,
    "silu": lambda x: x / (1.0 + np.exp(-x)),
    "elu": lambda x: np.where(x > 0.0, x, np.expm1(np.minimum(x, 0.0))),
}
SIZES = [(1, 1), (7, 8, 2), (76, 33, 31, 7)]


def written_out(net, features):
    """The outputs in float64, by NumPy."""
    x = features.astype(np.float64)
    for weights, biases in zip(net.weights[:-1], net.biases[:-1], strict=True):
        x = FORMULAS[net.activation](x @ weights.T.astype(np.float64) + biases)
    x = x @ net.weights[-1].T.astype(np.float64) + net.biases[-1]
    return {"tanh": np.tanh, "clip": lambda y: np.clip(y, -1.0, 1.0), "linear": lambda y: y}[net.squash](x)


def features(rows, size, seed=1):
    return np.random.default_rng(seed).normal(0.0, 3.0, (rows, size)).astype(np.float32)


@pytest.mark.parametrize("sizes", SIZES, ids=str)
@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_outputs_are_those_of_the_formula(activation, sizes):
    for squash in SQUASHES:
        net, x = network(sizes, activation, squash), features(50, sizes[0])
        outputs = net.forward(x)
        assert outputs.dtype == np.float32
        np.testing.assert_allclose(outputs, written_out(net, x), rtol=1e-5, atol=1e-5)
        assert np.abs(outputs).max() <= 1.0 or squash == "linear"
        assert np.ptp(outputs) > 0.5


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_rows_are_single_calls(activation):
    net = network((76, 64, 33, 7), activation)
    x = features(70, 76)
    whole = net.forward(x)
    for rows in (1, 2, 5):
        parts = [net.forward(x[i : i + rows]) for i in range(0, len(x), rows)]
        assert identical(np.concatenate(parts), whole)
    assert identical(net.forward(x[::-1]), whole[::-1].copy())


def test_extreme_numbers():
    for activation in ACTIVATIONS:
        net = network((4, 8, 2), activation, "clip")
        assert np.abs(net.forward(np.full((1, 4), 1e30, dtype=np.float32))).max() <= 1.0
    net = Network((np.array([[3e38, 3e38], [3e38, -3e38]]), np.ones((1, 2))), (np.zeros(2), np.zeros(1)), "elu")
    assert np.isnan(net.forward(np.array([[-3e38, 3e38]], dtype=np.float32))).all()  # the sum overflows


def test_networks_are_frozen_copies():
    weights, biases = [np.ones((2, 3))], [np.zeros(2)]
    net = Network(tuple(weights), tuple(biases))
    before = net.forward(np.ones((1, 3), dtype=np.float32))
    weights[0][:] = 7.0
    for other in (net, copy.deepcopy(net), pickle.loads(pickle.dumps(net))):
        assert identical(other.forward(np.ones((1, 3), dtype=np.float32)), before)
        arrays = [*other.weights, *other.biases, *(a for a in other.constants if isinstance(a, np.ndarray))]
        assert not any(array.flags.writeable for array in arrays)
    assert net.sizes == (3, 2)


@pytest.mark.parametrize(
    ("weights", "biases", "message"),
    [
        ((), (), "layers: expected at least one"),
        ((np.ones((2, 3)),), (), "got 1 and 0"),
        ((np.ones((2, 3)),), (np.ones(3),), r"weights of layer 0: expected shape \(3, 3\), got \(2, 3\)"),
        ((np.ones((2, 3)), np.ones((1, 3))), (np.ones(2), np.ones(1)), r"layer 1: expected shape \(1, 2\)"),
        ((np.ones((2, 3)),), (np.ones((2, 1)),), "biases of layer 0: expected 1 axes"),
        ((np.full((2, 3), np.nan),), (np.ones(2),), "weights of layer 0: expected finite"),
        ((np.ones((2, 3)),), (np.array([1.0, np.inf]),), "biases of layer 0: expected finite"),
    ],
)
def test_refused(weights, biases, message):
    with pytest.raises(InvalidInputError, match=message):
        Network(weights, biases)
