"""The features and the law of the bilinear agent."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

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
from ikgym.validation import Bounds, FloatArray


@dataclasses.dataclass(frozen=True)
class Bilinear(Processing):
    """q̇ = G v + h s: joint velocities linear in the remaining twist, with G and h by a network.

    v is the twist that removes the error from the next reference pose within Δt: feedback and feed-forward in one. The
    law is homogeneous in the error, so that an error of 10 % in G still removes nine tenths of the error in each step,
    whatever its size; the network need not be precise to be accurate. s is the speed of the reference ahead, 0.02 plus
    the root mean square of the mean twists shown, and h s moves the arm in its null space. (G, h) depend on the joint
    coordinates and on the reference trajectory, and change slowly: they may be held for some steps.

    The network adds to a weighted damped inverse of the Jacobian J: with its outputs G' and h',

        G = G' + U Jᵀ (J U Jᵀ + λ I)⁻¹,  h = (I - G J) h'.

    Its last outputs are ln λ, relative to `damping`, and ln U, the diagonal of a metric, relative to the one of
    :func:`baselines.agents.bilinear.features.metric_rows`, in which a fast joint counts less. The untrained agent is
    weighted damped least squares and need not learn the kinematics of the arm.

    With the offsets o_1 < o_2 < … and v_i the mean twist from o_i to o_(i+1), of w components, the features are:

    | number | feature |
    |---|---|
    | 2 each | sin q_j and cos q_j of revolute joints, except joint 1 where twists are seen from its frame |
    | 1 each | q_j of prismatic joints |
    | w each | v_i / s |
    | 1 | ln s |
    | 1 | steps left, as a share of 500, at most 1 |
    | n each | 0.3 times the joint rates for v_i / s, see :mod:`baselines.agents.bilinear.features` |

    Args:
        offsets: o, steps ahead at which the reference is seen, rising from 1, at least two.
        damping: λ at a network output of 0, above 0.
        interval: Steps for which (G, h) were held in the training, and are held where a policy says nothing else.

    Raises:
        InvalidInputError: Offsets do not rise from 1, the damping is not above 0, or the interval is no whole number
            from 1.
    """

    offsets: tuple[int, ...] = (1, 10, 40, 80, 130, 200, 300, 450, 650, 900)
    damping: Annotated[float, Bounds(above=0.0)] = 1e-2
    interval: Annotated[int, Bounds(at_least=1)] = 8

    #: The offsets as kernels take them.
    _ahead: npt.NDArray[np.int64] = dataclasses.field(init=False, repr=False, compare=False)

    kind: ClassVar[str] = "bilinear"

    def __post_init__(self) -> None:
        super().__post_init__()
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
        self._settle(offsets=offsets, _ahead=ahead)

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """See :meth:`Processing.from_json`; the field `predicted_rates` of older versions is passed over."""
        return super().from_json({name: value for name, value in values.items() if name != "predicted_rates"})

    def steps(self, problem: Problem) -> tuple[int, ...]:
        """See :meth:`Processing.steps`."""
        del problem
        return self.offsets

    def size(self, problem: Problem) -> int:
        """The number of features."""
        kind = problem.task.kind
        shown: int = shown_joints(kind, problem.model.chain.prismatic)
        return shown + (len(self.offsets) - 1) * (int(twist_size(kind)) + problem.model.joints) + 2

    def outputs(self, problem: Problem) -> int:
        """The number of network outputs: row j of G and h_j, joint by joint, then ln λ and ln U.

        Raises:
            InvalidInputError: The task shows skew coordinates, whose errors are no twists.
        """
        if problem.task.kind == task_kernels.SKEW:
            raise InvalidInputError("task: expected another than skew coordinates, whose errors are no twists.")
        return self.held_size(problem) + 1 + problem.model.joints

    def held_size(self, problem: Problem) -> int:
        """The number of values that are held between evaluations of the network: those of G and h."""
        return problem.model.joints * (int(twist_size(problem.task.kind)) + 1)

    def act(self, problem: Problem, batch: Batch, network: Network, interval: int, held: Held) -> FloatArray:
        """See :meth:`Processing.act`."""
        out = np.empty(batch.q.shape)
        scene = problem.task.kind, problem.model.chain, problem.dt, self._ahead
        observed = tuple(batch[: len(OBSERVED)])
        law_rows(scene, self.damping, problem.velocity_limit, network.constants, observed, interval, *held, out)
        return out
