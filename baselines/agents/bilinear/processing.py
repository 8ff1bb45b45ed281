"""The features and the law of the bilinear agent."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from baselines.agents.bilinear.features import shown_joints
from baselines.agents.bilinear.kernels import law_rows
from baselines.agents.network import Network
from baselines.agents.processing import Held, Processing
from baselines.policy import Batch, Problem
from ikgym.exceptions import InvalidInputError
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.outcome import OBSERVED
from ikgym.rl.twists import twist_size
from ikgym.scenarios.preview import offsets as checked_offsets
from ikgym.validation import FloatArray, number, whole_number


@dataclasses.dataclass(frozen=True)
class Bilinear(Processing):
    """q̇ = G v + h s: joint velocities linear in the remaining twist, with G and h from the network.

    v is the twist that removes the error from the next reference pose within Δt: feedback and feed-forward in one. The
    law is homogeneous in the error, so that an error of 10 % in G still removes nine tenths of the error in each step,
    whatever its size; the network need not be precise to be accurate. s is the speed of the reference ahead, 0.02 plus
    the root mean square of the mean twists shown, and h s moves the arm in its null space. (G, h) depend on the joint
    coordinates and on the reference trajectory, and change slowly: they may be held for some steps.

    The features are those of :func:`baselines.agents.bilinear.features.context_rows`. With the offsets o_1 < o_2 < …
    and v_i the mean twist from o_i to o_(i+1), of w components:

    | number | feature |
    |---|---|
    | 2 each | sin q_j and cos q_j of revolute joints, except joint 1 where twists are seen from its frame |
    | 1 each | q_j of prismatic joints |
    | w each | v_i / s |
    | 1 | ln s |
    | 1 | steps left, as a share of 500, at most 1 |
    | n each | with a damping: 0.3 times the joint rates for v_i / s, see :mod:`baselines.agents.bilinear.rates` |

    With a damping, the network adds to a weighted damped inverse of the Jacobian J, and G is

        G + U Jᵀ (J U Jᵀ + λ I)⁻¹,

    where the last outputs of the network are ln λ, relative to `damping`, and ln U, the diagonal of a metric, relative
    to the one of :func:`baselines.agents.bilinear.rates.metric_rows`, in which a fast joint counts less. h is then
    projected into the null space: (I - G J) h takes its place. The untrained agent is weighted damped least squares
    and need not learn the kinematics of the arm.

    Args:
        offsets: o, steps ahead at which the reference is seen, rising from 1, at least two.
        damping: λ at a network output of 0, above 0; None for G and h alone.
        interval: Steps for which (G, h) were held in the training, and are held where a policy says nothing else.

    Raises:
        InvalidInputError: Offsets do not rise from 1, the damping is not above 0, or the interval is no whole number
            from 1.
    """

    offsets: tuple[int, ...] = (1, 10, 40, 80, 130, 200, 300, 450, 650, 900)
    damping: float | None = None
    interval: int = 8

    #: The offsets as kernels take them.
    _ahead: npt.NDArray[np.int64] = dataclasses.field(init=False, repr=False, compare=False)

    kind: ClassVar[str] = "bilinear"

    def __post_init__(self) -> None:
        try:
            offsets = checked_offsets(self.offsets)
        except InvalidInputError as e:
            raise InvalidInputError(str(e).replace("preview", "offsets", 1)) from None
        if len(offsets) < 2 or offsets[0] != 1:
            raise InvalidInputError(
                f"offsets: expected steps ahead that rise from 1, at least two, got {self.offsets}."
            )
        ahead = np.array(offsets, dtype=np.int64)
        ahead.flags.writeable = False
        damping = None if self.damping is None else number("damping", self.damping, above=0.0)
        interval = whole_number("interval", self.interval, at_least=1)
        for field, value in {"offsets": offsets, "damping": damping, "interval": interval, "_ahead": ahead}.items():
            object.__setattr__(self, field, value)

    def to_json(self) -> dict[str, Any]:
        """See :meth:`Processing.to_json`; `predicted_rates` is there for readers of older versions."""
        return {**super().to_json(), "predicted_rates": self.damping is not None}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """See :meth:`Processing.from_json`.

        Raises:
            UnknownNameError: A key is not a field.
            InvalidInputError: A value is refused, or the agent sees joint rates that are not predicted.
        """
        own = {"predicted_rates": False, "matrix": True, **values}
        if bool(own.pop("predicted_rates")) != (own.get("damping") is not None) or not own.pop("matrix"):
            raise InvalidInputError("damping: expected it together with predicted rates and a matrix.")
        return super().from_json(own)

    def steps(self, problem: Problem) -> tuple[int, ...]:
        """See :meth:`Processing.steps`."""
        del problem
        return self.offsets

    def size(self, problem: Problem) -> int:
        """The number of features."""
        kind = problem.task.kind
        shown: int = shown_joints(kind, problem.model.chain.prismatic)
        rates = 0 if self.damping is None else problem.model.joints
        return shown + (len(self.offsets) - 1) * (int(twist_size(kind)) + rates) + 2

    def outputs(self, problem: Problem) -> int:
        """The number of network outputs: row j of G and h_j, joint by joint, and with a damping ln λ and ln U.

        Raises:
            InvalidInputError: There is a damping, and the task shows skew coordinates, whose errors are no twists.
        """
        kind, n = problem.task.kind, problem.model.joints
        if self.damping is not None and kind == task_kernels.SKEW:
            raise InvalidInputError(
                f"damping: expected None for skew coordinates, whose errors are no twists, got {self.damping}; train "
                "agents for them on whole poses (task pose)."
            )
        return n * (int(twist_size(kind)) + 1) + (0 if self.damping is None else 1 + n)

    def held(self, problem: Problem) -> int:
        """The number of values that are held between evaluations of the network: those of G and h."""
        return problem.model.joints * (int(twist_size(problem.task.kind)) + 1)

    def act(self, problem: Problem, batch: Batch, network: Network, interval: int, held: Held) -> FloatArray:
        """See :meth:`Processing.act`."""
        out = np.empty(batch.q.shape)
        scene = problem.task.kind, problem.model.chain, problem.dt, self._ahead
        damping = 0.0 if self.damping is None else self.damping
        observed = tuple(batch[: len(OBSERVED)])
        law_rows(scene, damping, problem.velocity_limit, network.constants, observed, interval, *held, out)
        return out
