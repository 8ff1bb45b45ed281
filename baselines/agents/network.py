"""The network of an agent: a multi-layer perceptron in float32, one kernel from features to output."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Self

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.kernels.jit import inner, kernel
from ikgym.validation import one_of

Singles = npt.NDArray[np.float32]

#: The tensors of a layer.
PARTS = ("weight", "bias")
#: Activations between the layers; the kernel knows them by their index.
ACTIVATIONS = ("relu", "tanh", "silu", "elu")
#: Functions that limit the outputs of the last layer to [-1, 1]; linear leaves them unchanged.
SQUASHES = ("clip", "tanh", "linear")

# Inputs added in one sweep over the outputs: each sweep reads and writes all outputs.
SWEEP = 8

_RELU, _TANH, _SILU, _ELU = (ACTIVATIONS.index(name) for name in ("relu", "tanh", "silu", "elu"))
_SQUASH_CLIP, _SQUASH_TANH, _ = range(len(SQUASHES))
_ONE = np.float32(1.0)


@dataclasses.dataclass(frozen=True, eq=False)
class Network(Frozen):
    """y ← activation(W y + b), layer by layer; the last layer has a squash instead of an activation.

    Args:
        weights: W of each layer. Shapes (outputs, inputs), those of a layer the outputs of the one before.
        biases: b of each layer. Shapes (outputs,).
        activation: One of :data:`ACTIVATIONS`, after all layers but the last.
        squash: One of :data:`SQUASHES`, after the last layer.

    Raises:
        UnknownNameError: There is no such activation or squash.
        InvalidInputError: There is no layer, layers do not fit together, or a number is not finite.
    """

    weights: tuple[Singles, ...]
    biases: tuple[Singles, ...]
    activation: Annotated[str, one_of(ACTIVATIONS)] = "relu"
    squash: Annotated[str, one_of(SQUASHES)] = "clip"

    #: Inputs, widths of the hidden layers, and outputs.
    sizes: tuple[int, ...] = dataclasses.field(init=False)
    #: The arguments of the kernel that never change.
    constants: tuple[object, ...] = dataclasses.field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        weights, biases = _layers("weights", self.weights, 2), _layers("biases", self.biases, 1)
        if not weights or len(weights) != len(biases):
            raise InvalidInputError(
                f"layers: expected at least one, each with weights and biases, got {len(weights)} and {len(biases)}."
            )
        sizes = (weights[0].shape[1], *(len(bias) for bias in biases))
        for number, (matrix, shape) in enumerate(zip(weights, zip(sizes[1:], sizes, strict=False), strict=True)):
            if matrix.shape != shape or 0 in shape:
                raise InvalidInputError(f"weights of layer {number}: expected shape {shape}, got {matrix.shape}.")
        packed = np.concatenate([matrix.T.ravel() for matrix in weights]), np.concatenate(biases), np.array(sizes)
        for array in (*weights, *biases, *packed):
            array.flags.writeable = False
        constants = (*packed, ACTIVATIONS.index(self.activation), SQUASHES.index(self.squash))
        self._settle(weights=weights, biases=biases, sizes=sizes, constants=constants)

    @property
    def tensors(self) -> dict[str, Singles]:
        """All tensors by name, layer by layer."""
        layers = enumerate(zip(self.weights, self.biases, strict=True))
        return {f"layers.{k}.{part}": tensor for k, pair in layers for part, tensor in zip(PARTS, pair, strict=True)}

    def to_json(self) -> dict[str, Any]:
        """The sizes, activation and squash."""
        return {"sizes": list(self.sizes), "activation": self.activation, "squash": self.squash}

    @classmethod
    def from_json(cls, about: Mapping[str, Any], tensors: Mapping[str, npt.NDArray[Any]]) -> Self:
        """The inverse of :meth:`to_json`, with the tensors.

        Raises:
            InvalidInputError: They do not fit together.
        """
        sizes = tuple(int(size) for size in about["sizes"])
        expected: dict[str, tuple[int, ...]] = {}
        for k, (inputs, outputs) in enumerate(itertools.pairwise(sizes)):
            expected |= {f"layers.{k}.weight": (outputs, inputs), f"layers.{k}.bias": (outputs,)}
        got = {name: tensor.shape for name, tensor in tensors.items()}
        if got != expected or any(tensor.dtype != np.float32 for tensor in tensors.values()):
            raise InvalidInputError(f"tensors: expected float32 of the shapes {expected}, got {got}.")
        weights, biases = ([tensors[f"layers.{k}.{part}"] for k in range(len(sizes) - 1)] for part in PARTS)
        return cls(tuple(weights), tuple(biases), about["activation"], about["squash"])

    def forward(self, features: Singles) -> Singles:
        """The output of the network; a row of a batch is the single call, bit for bit.

        Args:
            features: Shape (B, inputs).

        Returns:
            Numbers, in [-1, 1] unless `squash` is linear; NaN where the sums overflow. Shape (B, outputs).

        Raises:
            InvalidInputError: The features have another shape or are not in float32.
        """
        if features.dtype != np.float32 or features.ndim != 2 or features.shape[1] != self.sizes[0]:
            raise InvalidInputError(
                f"features: expected float32 of shape (any, {self.sizes[0]}), got {features.dtype} {features.shape}."
            )
        out = np.empty((len(features), self.sizes[-1]), dtype=np.float32)
        forward_rows(*self.constants, np.ascontiguousarray(features), out)
        return out


def _layers(name: str, arrays: Sequence[npt.ArrayLike], axes: int) -> tuple[Singles, ...]:
    """Copies as float32."""
    layers = tuple(np.array(array, dtype=np.float32, order="C") for array in arrays)
    for number, layer in enumerate(layers):
        if layer.ndim != axes:
            raise InvalidInputError(f"{name} of layer {number}: expected {axes} axes, got shape {layer.shape}.")
        if not np.isfinite(layer).all():
            raise InvalidInputError(f"{name} of layer {number}: expected finite numbers, got NaN or infinity.")
    return layers


@kernel
def forward_rows(weights, biases, sizes, activation, squash, features, out):
    """The forward pass, row by row.

    The outer loop runs over the inputs, the inner one over the outputs: that is contiguous in memory and can be
    vectorised without a change of the order of summation, so that a row of a batch is the single call, bit for bit.

    Args:
        weights: Wᵀ of all layers, one after the other, flat.
        biases: b of all layers, one after the other.
        sizes: See :class:`Network`.
        activation: Index in :data:`ACTIVATIONS`.
        squash: Index in :data:`SQUASHES`.
        features: Shape (B, inputs).
        out: Receives the outputs. Shape (B, outputs).
    """
    layers, widest = sizes.shape[0] - 1, sizes.max()
    x, y = np.empty(widest, np.float32), np.empty(widest, np.float32)
    for row in range(features.shape[0]):
        x[: sizes[0]] = features[row]
        begin, first = 0, 0
        for layer in range(layers):
            inputs, outputs = sizes[layer], sizes[layer + 1]
            matrix = weights[begin : begin + inputs * outputs]
            y[:outputs] = biases[first : first + outputs]
            multiply_add(matrix, x[:inputs], y[:outputs])
            if layer < layers - 1:
                activate(activation, y[:outputs])
            begin, first = begin + inputs * outputs, first + outputs
            x, y = y, x
        for j in range(out.shape[1]):
            value = x[j]
            if squash == _SQUASH_TANH:
                value = np.float32(math.tanh(value))
            elif squash == _SQUASH_CLIP and abs(value) > _ONE:  # NaN stays
                value = math.copysign(_ONE, value)
            out[row, j] = value


@inner
def multiply_add(matrix, x, y):
    """``y += W x`` with Wᵀ flat: shapes (inputs outputs,), (inputs,), (outputs,)."""
    n, i = y.shape[0], 0
    while i + SWEEP <= x.shape[0]:
        w = matrix[i * n : (i + SWEEP) * n]
        w0, w1, w2, w3 = w[:n], w[n : 2 * n], w[2 * n : 3 * n], w[3 * n : 4 * n]
        w4, w5, w6, w7 = w[4 * n : 5 * n], w[5 * n : 6 * n], w[6 * n : 7 * n], w[7 * n :]
        x0, x1, x2, x3, x4, x5, x6, x7 = x[i], x[i + 1], x[i + 2], x[i + 3], x[i + 4], x[i + 5], x[i + 6], x[i + 7]
        for j in range(n):
            low = (((y[j] + x0 * w0[j]) + x1 * w1[j]) + x2 * w2[j]) + x3 * w3[j]
            y[j] = (((low + x4 * w4[j]) + x5 * w5[j]) + x6 * w6[j]) + x7 * w7[j]
        i += SWEEP
    for rest in range(i, x.shape[0]):
        w = matrix[rest * n : (rest + 1) * n]
        for j in range(n):
            y[j] += x[rest] * w[j]


@inner
def activate(activation, y):
    """The activation, in place. Shape (outputs,)."""
    for j in range(y.shape[0]):
        value = y[j]
        if activation == _RELU:
            y[j] = max(value, np.float32(0.0))
        elif activation == _TANH:
            y[j] = math.tanh(value)
        elif activation == _SILU:
            y[j] = value / (_ONE + np.float32(math.exp(-value)))
        elif activation == _ELU and value < 0.0:
            y[j] = math.expm1(value)
