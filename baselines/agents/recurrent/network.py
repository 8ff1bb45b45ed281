"""A gated recurrent network in float32, one kernel a step (Cho et al. 2014, in the form of PyTorch's GRUCell)."""

import dataclasses
import itertools
import math
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from baselines.agents.network import Singles, check_tensors, multiply_add
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.jit import inlined, inner
from ikgym.validation import Frozen

#: The parts of a layer: from its inputs and from its own state to reset gate, update gate and candidate.
PARTS = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
_ONE = np.float32(1.0)


@dataclasses.dataclass(frozen=True, eq=False)
class GatedNetwork(Frozen):
    """Layers of gated recurrent units, and a linear layer behind them.

    Args:
        sizes: Inputs, units of each layer, outputs.
        tensors: By name, as PyTorch has them: ``layers.K.weight_ih`` and the others of :data:`PARTS`, then
            ``head.weight`` and ``head.bias``; float32.

    Raises:
        InvalidInputError: A tensor is missing, too many, of another shape or type, or not finite.
    """

    sizes: tuple[int, ...]
    tensors: dict[str, Singles]

    #: All tensors in one row, matrices transposed, and the sizes, as the kernel takes them.
    constants: tuple[object, ...] = dataclasses.field(init=False, repr=False)

    def __post_init__(self) -> None:
        expected = shapes(self.sizes)
        check_tensors(self.tensors, expected)
        tensors = {name: self.tensors[name] for name in expected}
        packed = np.concatenate([tensor.T.ravel() for tensor in tensors.values()])
        packed.flags.writeable = False
        object.__setattr__(self, "tensors", tensors)
        object.__setattr__(self, "constants", (packed, np.array(self.sizes)))

    def to_json(self) -> dict[str, Any]:
        """The sizes."""
        return {"sizes": list(self.sizes)}

    @classmethod
    def from_json(cls, about: Mapping[str, Any], tensors: Mapping[str, npt.NDArray[Any]]) -> Self:
        """The inverse of :meth:`to_json`, with the tensors.

        Raises:
            InvalidInputError: They do not fit together.
        """
        return cls(tuple(int(size) for size in about["sizes"]), dict(tensors))

    @property
    def units(self) -> int:
        """The size of its hidden state."""
        return sum(self.sizes[1:-1])


def shapes(sizes: tuple[int, ...]) -> dict[str, tuple[int, ...]]:
    """The tensors of a network by name, in their order.

    Raises:
        InvalidInputError: There is no layer, or one without units.
    """
    if len(sizes) < 3 or min(sizes) < 1:
        raise InvalidInputError(f"sizes: expected inputs, units of at least one layer, and outputs, got {sizes}")
    out: dict[str, tuple[int, ...]] = {}
    for number, (inputs, units) in enumerate(itertools.pairwise(sizes[:-1])):
        of_layer = ((3 * units, inputs), (3 * units, units), (3 * units,), (3 * units,))
        out |= {f"layers.{number}.{part}": shape for part, shape in zip(PARTS, of_layer, strict=True)}
    return {**out, "head.weight": (sizes[-1], sizes[-2]), "head.bias": (sizes[-1],)}


@inlined
def _sigmoid(x):
    return _ONE / (_ONE + np.float32(math.exp(-x)))


@inner
def step_network(packed, sizes, x, hidden, out):
    """One step: h ← (1 - z) n + z h with the gates r, z = σ(W x + U h + b) and n = tanh(W x + b + r (U h + b)).

    Args:
        packed: Of :attr:`GatedNetwork.constants`.
        sizes: Likewise.
        x: Inputs. Shape (f,).
        hidden: The states of all layers, one after the other, changed in place. Shape (units,).
        out: Receives the outputs. Shape (o,).
    """
    at, first = 0, 0
    for layer in range(sizes.shape[0] - 2):
        inputs, units = sizes[layer], sizes[layer + 1]
        rows, state = 3 * units, hidden[first : first + units]
        biases = at + rows * (inputs + units)
        fresh, kept = packed[biases : biases + rows].copy(), packed[biases + rows : biases + 2 * rows].copy()
        multiply_add(packed[at : at + rows * inputs], x[:inputs], fresh)
        multiply_add(packed[at + rows * inputs : biases], state, kept)
        for j in range(units):
            reset = _sigmoid(fresh[j] + kept[j])
            update = _sigmoid(fresh[units + j] + kept[units + j])
            candidate = np.float32(math.tanh(fresh[2 * units + j] + reset * kept[2 * units + j]))
            state[j] = (_ONE - update) * candidate + update * state[j]
        x, at, first = state, biases + 2 * rows, first + units
    last = sizes[-2] * sizes[-1]
    out[:] = packed[at + last : at + last + sizes[-1]]
    multiply_add(packed[at : at + last], x, out)
