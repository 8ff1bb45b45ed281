"""What an agent sees, and what its answer means: one definition for training and evaluation."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Problem
from baselines.solvers.linear_algebra import damped_step
from ikgym import task_kernels
from ikgym.exceptions import InvalidInputError
from ikgym.jit import inlined, kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.validation import FloatArray, Frozen, known_names, number, whole_number

Features = npt.NDArray[np.float32]

#: Beyond this no feature goes: asinh has turned 1e5 into 12 there.
LARGEST = 12.0
#: Added to the speed of what is to come, in [m/s], [rad/s] or [1/s]: at rest there is nothing to measure by.
SLOWEST = 0.02


@dataclasses.dataclass(frozen=True)
class Processing(Frozen):
    """From observations to the features of a network, and from its answer to actions.

    Precision at 1 kHz needs more than the raw observation: an error of 1 mm hides in the fourth digit of a pose, and
    costs of slow and fast trajectories are decades apart. So all velocities are measured by the speed s of what is to
    come, the root mean square of the nominal velocities shown (and 0.02 more, so that it is never 0). With X^N(k + o)
    the nominal coordinates at the offsets o_1 < o_2 < …, and ⌊x⌉ = asinh x, cut at ±12, which is linear where numbers
    are small and logarithmic where they are large, the features are, in this order:

    | number | feature |
    |---|---|
    | 2 n | sin q_j and cos q_j; of a joint that slides ⌊q_j⌉ and 0 |
    | n | ⌊q̇_j / s⌉ |
    | e | ⌊(present error) / Δx⌉, with Δx of the cost; X^N(k) is extrapolated from what o_1 and o_2 show |
    | e | ⌊(X^N(k + o_1) − x(k)) / (o_1 Δt s)⌉, the task velocity that would undo the error |
    | e each | ⌊v_i / s⌉, with v_i the mean nominal velocity from o_i to o_(i+1) |
    | 1 | ln s |
    | 1 | steps left, as a share of the furthest offset, at most 1 |
    | n | ⌊q̇ of the policy under the agent / s⌉; only where there is one |

    The joint velocity is s · action_scale · (the answer of the network, cut to [-1, 1]), on top of that of the policy under
    it, if there is one: an answer of 0 is that policy, bit for bit. Where the answer goes through the null space, it
    is multiplied by I − Jᵀ (J Jᵀ + λ I)⁻¹ J before, with the task Jacobian J of the model: the agent then moves the
    arm without moving its tool, but for directions that are nearly singular.

    Args:
        offsets: o, steps ahead at which the agent sees the nominal coordinates, rising, at least two.
        action_scale: What an answer of 1 means, as a multiple of the speed. Above 0.
        base_policy: The policy under the agent, such as ``"dls:damping=1e-2"``; None for an agent that stands alone.
        null_space: λ of the projector, above 0; None for answers that are taken as they are.

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

    def features(self, problem: Problem, batch: Batch, base: FloatArray | None = None) -> Features:
        """The features of a batch.

        Args:
            problem: What the agent is told of the scenario.
            batch: Observations; `nominal` at the offsets. Shape (B, …).
            base: Actions of the policy under the agent, None where there is none. Shape (B, n).

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
            *batch,
            np.empty((rows, 0)) if base is None else base,
            np.empty((len(self.offsets), e)),
            out,
        )
        return out

    def action(
        self, problem: Problem, batch: Batch, answer: npt.NDArray[Any], base: FloatArray | None = None
    ) -> FloatArray:
        """Actions, as fractions of the velocity limit, that may lie beyond the box.

        Args:
            problem: As in :meth:`features`.
            batch: As in :meth:`features`.
            answer: Of the network. Shape (B, n).
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
            answer.astype(np.float64),
            np.empty((len(self.offsets), problem.task.error_size)),
            out,
        )
        return out


@inlined
def compressed(x):
    """Asinh x, cut at ±LARGEST."""
    return min(max(math.asinh(x), -LARGEST), LARGEST)


@kernel
def speed_of(kind, dt, offsets, nominal, velocities):
    """The speed of what is to come, in the unit of task velocities.

    Args:
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        dt: Δt in [s].
        offsets: Shape (p,).
        nominal: At the offsets. Shape (p, m).
        velocities: Receives the mean velocities between the offsets in its first rows. Shape (p, e).
    """
    square, parts = 0.0, offsets.shape[0] - 1
    for i in range(parts):
        task_kernels.error(kind, nominal[i + 1], nominal[i], velocities[i])
        duration = (offsets[i + 1] - offsets[i]) * dt
        for a in range(velocities.shape[1]):
            velocities[i, a] /= duration
            square += velocities[i, a] * velocities[i, a]
    return SLOWEST + math.sqrt(square / (parts * velocities.shape[1]))


@kernel
def speed_rows(kind, dt, offsets, nominal, velocities):
    """What :func:`speed_of` gives, row by row.

    Args:
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        dt: Δt in [s].
        offsets: Shape (p,).
        nominal: At the offsets. Shape (B, p, m).
        velocities: Receives the mean velocities between the offsets in its first rows. Shape (B, p, e).

    Returns:
        Shape (B,).
    """
    out = np.empty(nominal.shape[0])
    for row in range(nominal.shape[0]):
        out[row] = speed_of(kind, dt, offsets, nominal[row], velocities[row])
    return out


@kernel
def feature_rows(
    kind,
    prismatic,
    dt,
    delta_x,
    velocity_limit,
    offsets,
    q,
    qdot,
    pose,
    nominal,
    remaining,
    base,
    velocities,
    out,
):
    """The features of :class:`Processing`, row by row.

    Args:
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        prismatic: Which joints slide. Shape (n,).
        dt: Δt in [s].
        delta_x: Δx of the cost.
        velocity_limit: Shape (n,).
        offsets: Shape (p,).
        q: Shape (B, n).
        qdot: Shape (B, n).
        pose: Shape (B, m).
        nominal: At the offsets. Shape (B, p, m).
        remaining: Shape (B, 1).
        base: Shape (B, n), or (B, 0) where there is none.
        velocities: Scratch. Shape (p, e).
        out: Receives the features. Shape (B, f).
    """
    n, (p, e) = q.shape[1], velocities.shape
    for row in range(q.shape[0]):
        features = out[row]
        speed = speed_of(kind, dt, offsets, nominal[row], velocities)
        for j in range(n):
            if prismatic[j]:
                features[2 * j], features[2 * j + 1] = compressed(q[row, j]), 0.0
            else:
                features[2 * j], features[2 * j + 1] = math.sin(q[row, j]), math.cos(q[row, j])
            features[2 * n + j] = compressed(qdot[row, j] / speed)
        error, lead = velocities[p - 1], offsets[0] * dt
        task_kernels.error(kind, nominal[row, 0], pose[row], error)
        at = 3 * n
        for a in range(e):
            features[at + a] = compressed((error[a] - lead * velocities[0, a]) / delta_x)
            features[at + e + a] = compressed(error[a] / (lead * speed))
            for i in range(p - 1):
                features[at + (2 + i) * e + a] = compressed(velocities[i, a] / speed)
        at += (1 + p) * e
        features[at] = math.log(speed)
        features[at + 1] = min(remaining[row, 0] / offsets[p - 1], 1.0)
        for j in range(base.shape[1]):
            features[at + 2 + j] = compressed(base[row, j] * velocity_limit[j] / speed)


@kernel
def action_rows(chain, kind, dt, velocity_limit, offsets, action_scale, damping, q, nominal, answer, velocities, out):
    """Adds what the answers mean to actions, row by row.

    Args:
        chain: The model of the arm.
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        dt: Δt in [s].
        velocity_limit: Shape (n,).
        offsets: Shape (p,).
        action_scale: See :class:`Processing`.
        damping: λ of the projector, 0 for none.
        q: Shape (B, n).
        nominal: At the offsets. Shape (B, p, m).
        answer: Of the network; cut in place. Shape (B, n).
        velocities: Scratch. Shape (p, e).
        out: The actions. Shape (B, n).
    """
    for row in range(q.shape[0]):
        for j in range(answer.shape[1]):
            answer[row, j] = min(max(answer[row, j], -1.0), 1.0)
    if damping > 0.0:
        project_rows(chain, kind, damping, velocities.shape[1], q, answer)
    for row in range(q.shape[0]):
        scale = action_scale * speed_of(kind, dt, offsets, nominal[row], velocities)
        for j in range(answer.shape[1]):
            out[row, j] += scale * answer[row, j] / velocity_limit[j]


@kernel
def project_rows(chain, kind, damping, size, q, velocity):
    """Multiplies joint velocities by I − Jᵀ (J Jᵀ + λ I)⁻¹ J, in place.

    Args:
        chain: The model of the arm.
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        damping: λ, above 0.
        size: e, errors of the task.
        q: Shape (B, n).
        velocity: Shape (B, n).
    """
    n = q.shape[1]
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    jacobian, gram, moved, taken_off = np.empty((size, n)), np.empty((size, size)), np.empty(size), np.empty(n)
    scratch = np.empty(size)
    for row in range(q.shape[0]):
        forward_and_jacobian(chain, q[row], rotation, position, geometric)
        task_kernels.jacobian(kind, rotation, geometric, jacobian)
        for a in range(size):
            moved[a] = 0.0
            for j in range(n):
                moved[a] += jacobian[a, j] * velocity[row, j]
        # Damping that is too small to count leaves nothing of the answer, rather than rounding errors.
        if not damped_step(jacobian, moved, damping, gram, scratch, taken_off):
            velocity[row] = 0.0
            continue
        for j in range(n):
            velocity[row, j] -= taken_off[j]
