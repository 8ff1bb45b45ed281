"""What an agent with memory corrects, what its filter begins with, and what the outputs of its network mean."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np

from baselines.agents.recurrent.kernels import FEATURES, OUTPUTS
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray, Frozen, known_names, number, whole_number

#: Who is corrected if nothing else is said: a receding horizon that identifies delay and lag of the drives.
BASE_POLICY = "predicted:policy=rhc,options={'horizon':60,'iterations':3,'move_blocks':8}"


@dataclasses.dataclass(frozen=True)
class Recurrent(Frozen):
    """The filter of :class:`baselines.solvers.adaptive.calibrated.Calibrated`, tuned by a network from pose to pose.

    Args:
        base_policy: The policy that is corrected.
        zero: Standard deviation of the joint zeros before anything is measured, in [rad] or [m].
        link: The same of each part of the offsets from joint to joint, and of the tool point, in [m].
        axis: The same of each of the two tilts of an axis, in [rad].
        start: How far from its reference the arm begins an episode, as a standard deviation in [m] and [rad].
        gap: Steps from one pose that is taken in to the next, at least.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    base_policy: str = BASE_POLICY
    zero: float = 5e-4
    link: float = 3e-4
    axis: float = 5e-4
    start: float = 1e-5
    gap: int = 1

    #: What files call it.
    kind: ClassVar[str] = "recurrent"
    #: Steps ahead that the network itself sees; the base policy sees more.
    offsets: ClassVar[tuple[int, ...]] = (1,)

    def __post_init__(self) -> None:
        if not isinstance(self.base_policy, str):
            raise InvalidInputError(f"base_policy: expected a policy as text, got {self.base_policy!r}.")
        for name in ("zero", "link", "axis", "start"):
            object.__setattr__(self, name, number(name, getattr(self, name), above=0.0))
        object.__setattr__(self, "gap", whole_number("gap", self.gap, at_least=1))

    def to_json(self) -> dict[str, Any]:
        """The fields, as JSON has them."""
        return {"kind": self.kind, **dataclasses.asdict(self)}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """What :meth:`to_json` gave.

        Raises:
            UnknownNameError: There is a key that is none of the fields.
            InvalidInputError: A value is refused.
        """
        known_names("field of the processing", values, ["kind", *(f.name for f in dataclasses.fields(cls))])
        return cls(**{name: value for name, value in values.items() if name != "kind"})

    def prior(self, joints: int) -> FloatArray:
        """Standard deviations of the parameters, see :mod:`baselines.solvers.adaptive.chain_parameters`. Shape (p,)."""
        return np.repeat([self.zero, self.link, self.axis], [joints, 3 * joints + 3, 2 * joints])

    @staticmethod
    def sizes(hidden: tuple[int, ...]) -> tuple[int, ...]:
        """Those of the network: inputs, units of each layer, outputs."""
        return FEATURES, *hidden, OUTPUTS
