"""The base policy of an agent with memory, and the prior of its filter."""

import dataclasses
from typing import ClassVar

import numpy as np

from baselines.agents.processing import Processing
from baselines.agents.recurrent.kernels import FEATURES, OUTPUTS
from baselines.agents.recurrent.network import GatedNetwork
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray, number, whole_number

#: The default base policy: a receding horizon that identifies delay and lag of the drives.
BASE_POLICY = "predicted:policy=rhc,options={'horizon':60,'iterations':3,'move_blocks':8}"


@dataclasses.dataclass(frozen=True)
class Recurrent(Processing):
    """The filter of :class:`baselines.solvers.adaptive.calibrated.Calibrated`, tuned by a network at each measurement.

    Args:
        base_policy: The policy that is corrected.
        zero: Prior standard deviation of the joint zeros, in [rad] or [m].
        link: The same of each part of the offsets from joint to joint, and of the tool point, in [m].
        axis: The same of each of the two tilts of an axis, in [rad].
        start: Standard deviation of the pose error at the start of an episode, in [m] and [rad].
        gap: Smallest number of steps between two measurements that the filter uses.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    base_policy: str = BASE_POLICY
    zero: float = 5e-4
    link: float = 3e-4
    axis: float = 5e-4
    start: float = 1e-5
    gap: int = 1

    kind: ClassVar[str] = "recurrent"
    network: ClassVar = GatedNetwork
    #: Steps ahead that the network itself sees; the base policy sees more.
    offsets: ClassVar[tuple[int, ...]] = (1,)

    def __post_init__(self) -> None:
        if not isinstance(self.base_policy, str):
            raise InvalidInputError(f"base_policy: expected a policy as text, got {self.base_policy!r}.")
        for name in ("zero", "link", "axis", "start"):
            object.__setattr__(self, name, number(name, getattr(self, name), above=0.0))
        object.__setattr__(self, "gap", whole_number("gap", self.gap, at_least=1))

    def prior(self, joints: int) -> FloatArray:
        """Standard deviations of the parameters, see :mod:`baselines.solvers.adaptive.chain_parameters`. Shape (p,)."""
        return np.repeat([self.zero, self.link, self.axis], [joints, 3 * joints + 3, 2 * joints])

    @staticmethod
    def sizes(hidden: tuple[int, ...]) -> tuple[int, ...]:
        """The sizes of the network: inputs, units of each layer, outputs."""
        return FEATURES, *hidden, OUTPUTS
