"""What agents see and do that were trained in the environments of :mod:`ikgym.rl`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self, get_args

import numpy as np
import numpy.typing as npt

from baselines.agents.alone import Alone
from baselines.agents.bilinear.processing import bilinear_outputs, held
from baselines.agents.features import Features
from baselines.agents.network import Network
from baselines.agents.relative.kernels import law_rows, velocity_rows
from baselines.policy import Batch, Problem
from ikgym.exceptions import InvalidInputError
from ikgym.preview import offsets as checked_offsets
from ikgym.rl.feature_kernels import observe_rows
from ikgym.rl.twists import shown_joints, twist_size
from ikgym.validation import FloatArray, Frozen, flag, known_name, known_names, number

Squash = Literal["clip", "tanh"]


@dataclasses.dataclass(frozen=True)
class Relative(Alone, Frozen):
    """Joint velocities in units of what is asked for, from the features of :class:`ikgym.rl.AgentObservation`.

    The velocity of a joint is a · s (0.2 + |v̂|), with a = gain · x, kept within ±largest. x is the network output; of a
    bilinear network it is (G v̂ + h) / (0.2 + |v̂|), where row j of G and h_j are its outputs.

    Args:
        offsets: Steps ahead at which the reference is seen, rising, at least two.
        furthest: Where |v̂| is cut, above 0.
        largest: In units, above 0.
        gain: Above 0.
        squash: What keeps a within its bounds: `clip` cuts it, `tanh` is largest · tanh(a / largest).
        bilinear: Whether the network gives G and h.
        damping: Of the inverse that G is added to, see :class:`baselines.agents.bilinear.processing.Bilinear`; None for
            no inverse.

    Raises:
        InvalidInputError: A value is out of its range.
        UnknownNameError: There is no such squash.
    """

    offsets: tuple[int, ...]
    furthest: float
    largest: float = 1.0
    gain: float = 1.0
    squash: Squash = "clip"
    bilinear: bool = False
    damping: float | None = None
    _steps: npt.NDArray[np.int64] = dataclasses.field(init=False, repr=False, compare=False)

    #: What files call it.
    kind: ClassVar[str] = "relative"

    def __post_init__(self) -> None:
        offsets = checked_offsets(self.offsets)
        if len(offsets) < 2:
            raise InvalidInputError(f"offsets: expected at least two steps ahead, got {self.offsets}.")
        known_name("squash", self.squash, get_args(Squash))
        flag("bilinear", self.bilinear)
        if self.damping is not None and not self.bilinear:
            raise InvalidInputError(f"damping: expected None unless bilinear, got {self.damping!r}.")
        numbers = ["furthest", "largest", "gain"] + ["damping"] * (self.damping is not None)
        values = {name: number(name, getattr(self, name), above=0.0) for name in numbers}
        steps = np.array(offsets, dtype=np.int64)
        steps.flags.writeable = False
        for field, value in {"offsets": offsets, "_steps": steps, **values}.items():
            object.__setattr__(self, field, value)

    def to_json(self) -> dict[str, Any]:
        """The fields, as JSON has them."""
        fields = {name: getattr(self, name) for name in _fields() if name != "damping" or self.damping is not None}
        return {"kind": self.kind, **fields, "offsets": list(self.offsets)}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """What :meth:`to_json` gave.

        Raises:
            UnknownNameError: There is a key that is none of the fields.
            InvalidInputError: A value is refused.
        """
        known_names("field of the processing", values, ["kind", *_fields()])
        fields = {name: values[name] for name in _fields() if name != "damping" or name in values}
        return cls(**{**fields, "offsets": tuple(fields["offsets"])})

    def size(self, problem: Problem) -> int:
        """The number of features."""
        kind = problem.task.kind
        w, shown = int(twist_size(kind)), int(shown_joints(kind, problem.model.chain.prismatic))
        return shown + len(self.offsets) * w + 3 + (w // 3 + 1) * problem.model.joints

    def outputs(self, problem: Problem) -> int:
        """The number of network outputs.

        Raises:
            InvalidInputError: As :func:`baselines.agents.bilinear.processing.bilinear_outputs`.
        """
        return bilinear_outputs(problem, self.damping) if self.bilinear else problem.model.joints

    def features(self, problem: Problem, batch: Batch, base: FloatArray | None = None) -> Features:
        """The features of a batch; see :meth:`baselines.agents.features.Processing.features`."""
        del base
        return self._observe(problem, batch)[0]

    def action(
        self, problem: Problem, batch: Batch, output: npt.NDArray[Any], base: FloatArray | None = None
    ) -> FloatArray:
        """Actions, as fractions of the velocity limit; see :meth:`baselines.agents.features.Processing.action`."""
        del base
        out = np.empty(batch.q.shape)
        if self.damping is not None:
            output = held(problem, self.damping, batch.q, output)
        velocity_rows(*self._output, problem.velocity_limit, *self._observe(problem, batch), output, out)
        return out

    def law(self, problem: Problem, batch: Batch, network: Network) -> FloatArray:
        """:meth:`action` of what a network says of :meth:`features`, bit for bit, in one compiled call."""
        out = np.empty(batch.q.shape)
        damping = 0.0 if self.damping is None else self.damping
        arguments = self._ahead(problem), self._output, damping, problem.velocity_limit
        law_rows(*arguments, network.constants, tuple(batch[:5]), out)
        return out

    def _observe(self, problem: Problem, batch: Batch) -> tuple[Features, FloatArray]:
        """Features, and units of velocities."""
        out, unit = np.empty((len(batch.q), self.size(problem)), np.float32), np.empty(len(batch.q))
        observe_rows(*self._ahead(problem), *batch[:5], out, unit)
        return out, unit

    @property
    def _output(self) -> tuple[Any, ...]:
        """What outputs mean, for the kernels."""
        return self.bilinear, self.squash == "tanh", self.gain, self.largest

    def _ahead(self, problem: Problem) -> tuple[Any, ...]:
        """What is seen, for the kernels."""
        return problem.task.kind, problem.model.chain, problem.dt, self._steps, self.furthest


def _fields() -> list[str]:
    """What files hold."""
    return [field.name for field in dataclasses.fields(Relative) if field.init]
