"""What the bilinear actor sees, and what the output of its network means."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from baselines.agents.alone import Alone
from baselines.agents.bilinear.damped_kernels import held_rows, with_matrix
from baselines.agents.bilinear.kernels import action_rows, due_rows, law_rows, new_features
from baselines.agents.bilinear.rate_kernels import HERE, NONE, PREDICTED, metric_rows
from baselines.agents.features import Features
from baselines.agents.network import Network
from baselines.policy import Batch, Problem
from ikgym import task_kernels
from ikgym.exceptions import InvalidInputError
from ikgym.rl.twists import shown_joints, twist_size
from ikgym.validation import FloatArray, Frozen, flag, known_names, number, whole_number


@dataclasses.dataclass(frozen=True)
class Bilinear(Alone, Frozen):
    """q̇ = G v + h s: joint velocities linear in the twist that is due, with G and h from the network.

    v is the twist that removes the error from the next reference pose within Δt: feedback and feed-forward in one. The
    law is homogeneous in the error, so that an error of 10 % in G still removes nine tenths of what is missing in each
    step, whatever its size; the network need not be precise to be accurate. s is the speed of what is ahead, 0.02 and
    the root mean square of the mean twists shown, and h s moves the arm in its null space. (G, h) depend on the joint
    coordinates and on the reference trajectory, and change slowly: they may be held for some steps.

    Twists are seen from the frame of joint 1, which a turn of joint 1 does not change, so that nothing has to be
    learned twice. Where joint 1 is prismatic, and for skew coordinates, which are no vector, they stay in the base
    frame. A twist has w components: 3 for tasks of position alone, else 6; an error of the tool's axis is that of the
    shortest rotation. The features are, with the offsets o_1 < o_2 < … and v_i the mean twist from o_i to o_(i+1):

    | number | feature |
    |---|---|
    | 2 each | sin q_j and cos q_j of revolute joints, but for joint 1 where twists are seen from its frame |
    | 1 each | q_j of prismatic joints |
    | w each | v_i / s |
    | 1 | ln s |
    | 1 | steps left, as a share of 500, at most 1 |
    | n each | with a damping: 0.3 Jᵀ (J Jᵀ + 0.01 I)⁻¹ v_i / s, what v_i would ask of the joints here |

    With a damping, G is what the network adds to a weighted damped inverse of the Jacobian J,

        U Jᵀ (J U Jᵀ + λ I)⁻¹,

    whose λ and diagonal metric U the network gives, too: its last outputs are ln λ against `damping`, and ln U against
    the metric of :mod:`baselines.agents.bilinear.rate_kernels`, in which a joint that would be fast counts less. What h
    would do to the tool is then taken back: (I - G J) h stands for h, with the whole G. The agent begins as weighted
    damped least squares, and need not learn the kinematics of the arm. Without `matrix` that is all: the network gives
    h, λ and U alone.

    Args:
        offsets: o, steps ahead at which the reference is seen, rising from 1, at least two.
        damping: λ where the network says 0, above 0; None for no inverse.
        matrix: Whether the network gives G. Without it there has to be a damping.
        predicted_rates: Whether what v_i would ask of the joints is seen at the posture where the arm would be then,
            see :mod:`baselines.agents.bilinear.prediction_kernels`. There has to be a damping.

    Raises:
        InvalidInputError: Offsets do not rise from 1, the damping is not above 0, neither G nor an inverse is left, or
            there are no joint rates to predict.
    """

    offsets: tuple[int, ...] = (1, 10, 40, 80, 130, 200, 300, 450, 650, 900)
    damping: float | None = None
    matrix: bool = True
    predicted_rates: bool = False

    #: The offsets as kernels take them.
    _ahead: npt.NDArray[np.int64] = dataclasses.field(init=False, repr=False, compare=False)

    #: What files call it.
    kind: ClassVar[str] = "bilinear"

    def __post_init__(self) -> None:
        offsets = tuple(whole_number("offsets", o, at_least=1) for o in self.offsets)
        rising = all(a < b for a, b in itertools.pairwise(offsets))
        if len(offsets) < 2 or offsets[0] != 1 or not rising:
            raise InvalidInputError(f"offsets: expected at least two, rising from 1, got {self.offsets}.")
        flag("matrix", self.matrix)
        if not self.matrix and self.damping is None:
            raise InvalidInputError("damping: expected a number where the network gives no matrix, got None.")
        flag("predicted_rates", self.predicted_rates)
        if self.predicted_rates and self.damping is None:
            raise InvalidInputError("damping: expected a number where joint rates are predicted, got None.")
        ahead = np.array(offsets, dtype=np.int64)
        ahead.flags.writeable = False
        damping = None if self.damping is None else number("damping", self.damping, above=0.0)
        for field, value in {"offsets": offsets, "damping": damping, "_ahead": ahead}.items():
            object.__setattr__(self, field, value)

    def to_json(self) -> dict[str, Any]:
        """The fields, as JSON has them."""
        inverse = {} if self.damping is None else {"damping": self.damping}
        alone = {} if self.matrix else {"matrix": False}
        rates = {"predicted_rates": True} if self.predicted_rates else {}
        return {"kind": self.kind, "offsets": list(self.offsets), **inverse, **alone, **rates}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """What :meth:`to_json` gave.

        Raises:
            UnknownNameError: There is a key that is none of the fields.
            InvalidInputError: A value is refused.
        """
        known_names("field of the processing", values, ["kind", "offsets", "damping", "matrix", "predicted_rates"])
        own = {name: value for name, value in values.items() if name not in ("kind", "offsets")}
        return cls(tuple(values.get("offsets", cls.offsets)), **own)

    @property
    def rates(self) -> int:
        """Which joint rates are seen: NONE, HERE or PREDICTED of :mod:`baselines.agents.bilinear.rate_kernels`."""
        if self.damping is None:
            return NONE
        return PREDICTED if self.predicted_rates else HERE

    def size(self, problem: Problem) -> int:
        """The number of features."""
        kind = problem.task.kind
        shown: int = shown_joints(kind, problem.model.chain.prismatic)
        rates = 0 if self.damping is None else problem.model.joints
        return shown + (len(self.offsets) - 1) * (int(twist_size(kind)) + rates) + 2

    def outputs(self, problem: Problem) -> int:
        """The number of network outputs: row j of G and h_j, joint by joint; ln λ and ln U where there is an inverse.

        Without G they are h, ln λ and ln U.

        Raises:
            InvalidInputError: As :func:`bilinear_outputs`.
        """
        outputs = bilinear_outputs(problem, self.damping)
        return outputs if self.matrix else 2 * problem.model.joints + 1

    def features(self, problem: Problem, batch: Batch, base: FloatArray | None = None) -> Features:
        """The features of a batch; see :meth:`baselines.agents.features.Processing.features`."""
        del base
        chain = problem.model.chain
        out: Features = new_features(
            problem.task.kind,
            chain,
            problem.dt,
            self._ahead,
            self.rates,
            batch.q,
            batch.nominal,
            batch.remaining,
        )
        return out

    def action(
        self, problem: Problem, batch: Batch, output: npt.NDArray[Any], base: FloatArray | None = None
    ) -> FloatArray:
        """Actions, as fractions of the velocity limit; see :meth:`baselines.agents.features.Processing.action`."""
        del base
        out, chain = np.empty(batch.q.shape), problem.model.chain
        if self.damping is not None:
            kind, output = problem.task.kind, np.array(output)
            if not self.matrix:
                output = with_matrix(twist_size(kind), output)
            metric_rows(kind, chain.prismatic, len(self.offsets) - 1, self.features(problem, batch), output)
            output = held(problem, self.damping, batch.q, output)
        action_rows(
            problem.task.kind,
            chain.prismatic,
            chain.axes[0],
            problem.dt,
            self._ahead,
            problem.velocity_limit,
            batch.q,
            batch.pose,
            batch.nominal,
            output,
            out,
        )
        return out

    def due(self, problem: Problem, batch: Batch) -> tuple[FloatArray, FloatArray]:
        """The twist that is due in units of the speed, v / s, of shape (B, w), and s, of shape (B,)."""
        chain, kind = problem.model.chain, problem.task.kind
        due, speed = np.empty((len(batch.q), int(twist_size(kind)))), np.empty(len(batch.q))
        arrays = batch.q, batch.pose, batch.nominal, due, speed
        due_rows(kind, chain.prismatic, chain.axes[0], problem.dt, self._ahead, *arrays)
        return due, speed

    def law(self, problem: Problem, batch: Batch, network: Network) -> FloatArray:
        """:meth:`action` of what a network says of :meth:`features`, bit for bit, in one compiled call."""
        out, chain = np.empty(batch.q.shape), problem.model.chain
        law_rows(
            problem.task.kind,
            chain,
            problem.dt,
            self._ahead,
            self.rates,
            0.0 if self.damping is None else self.damping,
            problem.velocity_limit,
            *network.constants,
            batch.q,
            batch.pose,
            batch.nominal,
            batch.remaining,
            out,
        )
        return out


def bilinear_outputs(problem: Problem, damping: float | None) -> int:
    """The number of outputs of a network that gives G and h, and λ and U where there is a damped inverse.

    Raises:
        InvalidInputError: There is an inverse, and the task shows skew coordinates, whose errors are no twists.
    """
    kind, n = problem.task.kind, problem.model.joints
    if damping is not None and kind == task_kernels.SKEW:
        raise InvalidInputError(
            f"damping: expected None for skew coordinates, whose errors are no twists, got {damping}; agents for them "
            "are trained on whole poses (task pose)."
        )
    return n * (int(twist_size(kind)) + 1) + (0 if damping is None else 1 + n)


def held(problem: Problem, damping: float, q: FloatArray, output: npt.NDArray[Any]) -> FloatArray:
    """(G, h) with the damped inverse in G, and h in the null space. Shape (B, n (w + 1)).

    Args:
        problem: What is tracked.
        damping: The usual λ.
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        output: Of the network. Shape (B, n (w + 1) + 1 + n).
    """
    kind, chain = problem.task.kind, problem.model.chain
    out = np.empty((len(q), q.shape[1] * (int(twist_size(kind)) + 1)))
    held_rows(kind, chain, damping, q, output, out)
    return out
