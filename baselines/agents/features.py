"""What an agent sees, and what the output of its network means: one definition for training and evaluation."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from baselines.agents.feature_kernels import LARGEST, action_rows, feature_rows, project_rows, speed_rows
from baselines.policy import Batch, Problem
from ikgym.exceptions import InvalidInputError
from ikgym.outcome import OBSERVED
from ikgym.validation import FloatArray, Frozen, known_names, number, whole_number

__all__ = ("LARGEST", "Features", "Processing", "project_rows", "speed_rows")

Features = npt.NDArray[np.float32]


@dataclasses.dataclass(frozen=True)
class Processing(Frozen):
    """From observations to the features of a network, and from its output to actions.

    Precision at 1 kHz needs more than the raw observation: an error of 1 mm hides in the fourth digit of a pose, and
    costs of slow and fast trajectories are decades apart. So all velocities are measured by the speed s of what is to
    come, the root mean square of the nominal velocities shown (and 0.02 more, so that it is never 0). With X^N(k + o)
    the nominal coordinates at the offsets o_1 < o_2 < …, and ⌊x⌉ = asinh x, cut at ±12, which is linear where numbers
    are small and logarithmic where they are large, the features are, in this order:

    | number | feature |
    |---|---|
    | 2 n | sin q_j and cos q_j; of a prismatic joint ⌊q_j⌉ and 0 |
    | n | ⌊q̇_j / s⌉ |
    | e | ⌊(present error) / Δx⌉, with Δx of the cost; X^N(k) is extrapolated from what o_1 and o_2 show |
    | e | ⌊(X^N(k + o_1) − x(k)) / (o_1 Δt s)⌉, the task velocity that would undo the error |
    | e each | ⌊v_i / s⌉, with v_i the mean nominal velocity from o_i to o_(i+1) |
    | 1 | ln s |
    | 1 | steps left, as a share of the furthest offset, at most 1 |
    | n | ⌊q̇ of the base policy / s⌉; only where there is one |

    The joint velocity is s · action_scale · (the network output, cut to [-1, 1]), on top of that of the base policy, if
    there is one: the agent then is a residual policy, and an output of 0 is the base policy, bit for bit. Where the
    output goes through the null space, it is multiplied by I − Jᵀ (J Jᵀ + λ I)⁻¹ J before, with the task Jacobian J of
    the model: the agent then moves the arm without moving its tool, but for directions that are nearly singular.

    Args:
        offsets: o, steps ahead at which the agent sees the nominal coordinates, rising, at least two.
        action_scale: What a network output of 1 means, as a multiple of the speed. Above 0.
        base_policy: The policy that the agent corrects, such as ``"dls:damping=1e-2"``; None for one that stands alone.
        null_space: λ of the projector, above 0; None for outputs that are taken as they are.

    Raises:
        InvalidInputError: Offsets do not rise from 1 or more, or a number is out of its range.
    """

    offsets: tuple[int, ...] = (1, 2, 10, 30, 60, 120, 240)
    action_scale: float = 4.0
    base_policy: str | None = None
    null_space: float | None = None

    def __post_init__(self) -> None:
        offsets = tuple(whole_number("offsets", o, at_least=1) for o in self.offsets)
        if len(offsets) < 2 or any(b <= a for a, b in itertools.pairwise(offsets)):
            raise InvalidInputError(f"offsets: expected at least two, each above the one before, got {self.offsets}.")
        if self.base_policy is not None and not isinstance(self.base_policy, str):
            raise InvalidInputError(f"base_policy: expected a policy as text, got {self.base_policy!r}.")
        object.__setattr__(self, "offsets", offsets)
        object.__setattr__(self, "action_scale", number("action_scale", self.action_scale, above=0.0))
        if self.null_space is not None:
            object.__setattr__(self, "null_space", number("null_space", self.null_space, above=0.0))

    def to_json(self) -> dict[str, Any]:
        """The fields, as JSON has them."""
        return {**dataclasses.asdict(self), "offsets": list(self.offsets)}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """What :meth:`to_json` gave.

        Raises:
            UnknownNameError: There is a key that is none of the fields.
            InvalidInputError: A value is refused.
        """
        known_names("field of the processing", values, [field.name for field in dataclasses.fields(cls)])
        return cls(**{**values, "offsets": tuple(values.get("offsets", cls.offsets))})

    def size(self, problem: Problem) -> int:
        """The number of features."""
        n, e = problem.model.joints, problem.task.error_size
        return (4 if self.base_policy else 3) * n + (1 + len(self.offsets)) * e + 2

    def outputs(self, problem: Problem) -> int:
        """The number of network outputs: one a joint."""
        return problem.model.joints

    def features(self, problem: Problem, batch: Batch, base: FloatArray | None = None) -> Features:
        """The features of a batch.

        Args:
            problem: What the agent is told of the scenario.
            batch: Observations; `nominal` at the offsets. Shape (B, …).
            base: Actions of the base policy, None where there is none. Shape (B, n).

        Returns:
            Shape (B, f), as float32.
        """
        rows, e = len(batch.q), problem.task.error_size
        out = np.empty((rows, self.size(problem)), dtype=np.float32)
        feature_rows(
            problem.task.kind,
            problem.model.chain.prismatic,
            problem.dt,
            problem.cost.delta_x,
            problem.velocity_limit,
            np.array(self.offsets, dtype=np.int64),
            *batch[: len(OBSERVED)],
            np.empty((rows, 0)) if base is None else base,
            np.empty((len(self.offsets), e)),
            out,
        )
        return out

    def action(
        self, problem: Problem, batch: Batch, output: npt.NDArray[Any], base: FloatArray | None = None
    ) -> FloatArray:
        """Actions, as fractions of the velocity limit, that may lie beyond the box.

        Args:
            problem: As in :meth:`features`.
            batch: As in :meth:`features`.
            output: Of the network. Shape (B, n).
            base: As in :meth:`features`.

        Returns:
            Shape (B, n), as float64.
        """
        out = np.zeros_like(batch.q) if base is None else base.astype(np.float64)
        action_rows(
            problem.model.chain,
            problem.task.kind,
            problem.dt,
            problem.velocity_limit,
            np.array(self.offsets, dtype=np.int64),
            self.action_scale,
            0.0 if self.null_space is None else self.null_space,
            batch.q,
            batch.nominal,
            output.astype(np.float64),
            np.empty((len(self.offsets), problem.task.error_size)),
            out,
        )
        return out
