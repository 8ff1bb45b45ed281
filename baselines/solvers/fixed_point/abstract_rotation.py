"""Adaptive inverse kinematics by abstract rotations, without inversion (Khan and Tar 2020)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Solution, SolverPolicy
from baselines.solvers.fixed_point.rotations import adaptive_deform, plane, turn
from baselines.solvers.linear_algebra import dot
from baselines.status import Status
from ikgym import task_kernels
from ikgym.exceptions import InvalidInputError
from ikgym.jit import kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.validation import FloatArray, number, per_joint

_CONVERGED, _LIMIT, _NO_ROTATION = int(Status.CONVERGED), int(Status.ITERATION_LIMIT), int(Status.NOT_A_ROTATION)


class Angles(NamedTuple):
    """How far the last step has turned (Fig. 6, 15 and 18); NaN where nothing was.

    Attributes:
        counter_rotation: Angle of 𝒩 in [rad], between 0 and π. Shape (B,).
        abstract_rotation: λ_a φ in [rad]. Shape (B,).
    """

    counter_rotation: FloatArray
    abstract_rotation: FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class AbstractRotation(SolverPolicy):
    """Turns q by a share of the rotation that leads from what is measured to what is wanted (eq. 3.16, section 4.1).

    One call is one inner iteration, and the arm moves: with the Jacobian J̃ = ∂f/∂q of the model at q and the measured
    coordinates f, the next joint coordinates are

        q(n+1) = AdaptiveDeform(𝒲 𝒩 J̃ᵀ ℱ f, q(n), 𝒲 𝒩 J̃ᵀ ℱ xᴺ),

    that is q(n), extended by a ninth number to the length R_a, turned by λ_a times the angle between the other two,
    in their plane. Where all three are short beside R_a this is q + λ_a 𝒲 𝒩 J̃ᵀ ℱ (xᴺ - f): a transposed-Jacobian
    step, which contracts for λ_a σ_max² < 2 if the model is close. A vector b that is not short, |b| = R_a sin β,
    makes the step 1/cos β times longer along b, and cos β times shorter across. At rest J̃ᵀ ℱ (xᴺ - f) = 0, up to
    the listing's limiting by tanh, which shrinks q by about q³ / (3 q_pp_max²) in every step: the joints creep home
    in the directions that the task leaves free.

    The counter-rotation 𝒩 turns h(n) = J̃ᵀ ℱ (xᴺ - f) into the direction of h(n-1), as it was before its own
    rotation; otherwise no direction could ever change. It is n × n, without which eq. 3.16 does not fit together
    (the conclusion says 12 dimensions). h is remembered from point to point, and is not known at the first step,
    where 𝒩 = I. Between opposite vectors the plane is not determined, see :func:`rotations.plane`.

    Slow where the arm is short, since λ_a σ² goes with the square of its length and there is one iteration a step; and
    along the directions of small σ, in which an error takes 1 / (λ_a σ²) steps: some 25,000 on the paper's arm, where
    σ² reaches from 0.08 to 340. Fails where the model's Jacobian points away from the arm's: then the error stays or
    grows, and the status never says ``converged`` of that. Where a vector is not shorter than R_a the status is
    ``not_a_rotation``, and the arm stands still until the target has come nearer.

    Args:
        problem: What the policy is told of the scenario.
        r_a: R_a, the common length of the extended vectors. In the mixed units of J̃ᵀ f, like all that is turned.
        lambda_a: λ_a, the share of the rotation that is applied. Above 0.
        epsa: What the listing adds to a norm before it divides by it. Above 0; not printed.
        q_pp_max: Where the listing limits joint coordinates, by a tanh, in [rad] or [m]; not printed.
        task_weights: The diagonal of ℱ, a number or one a task coordinate. Above 0, at most 1.
        joint_weights: The diagonal of 𝒲, a number or one a joint. Above 0, at most 1.
        counter_rotation: Whether 𝒩 is applied; without it 𝒩 = I.
        tolerance: ‖xᴺ - f‖ up to which the status is ``converged`` instead of ``iteration_limit``, in [m] and [1].

    Raises:
        InvalidInputError: A parameter is out of its range.
    """

    r_a: float = 100.0
    lambda_a: float = 5e-4
    epsa: float = 1e-12
    q_pp_max: float = 1e3
    task_weights: float | Sequence[float] = 1.0
    joint_weights: float | Sequence[float] = 1.0
    counter_rotation: bool = True
    tolerance: float = 1e-3
    _weights: tuple[FloatArray, FloatArray] = dataclasses.field(init=False, repr=False)

    name: ClassVar[str] = "abstract_rotation"

    def __post_init__(self) -> None:
        for name in ("r_a", "lambda_a", "epsa", "q_pp_max"):
            object.__setattr__(self, name, number(name, getattr(self, name), above=0.0))
        object.__setattr__(self, "tolerance", number("tolerance", self.tolerance, at_least=0.0))
        sizes = {"task_weights": self.problem.task.size, "joint_weights": self.problem.model.joints}
        weights = tuple(_checked_weights(name, getattr(self, name), size) for name, size in sizes.items())
        object.__setattr__(self, "_weights", weights)
        for name, array in zip(sizes, weights, strict=True):
            given = getattr(self, name)
            object.__setattr__(self, name, float(given) if np.ndim(given) == 0 else tuple(array.tolist()))
        if not isinstance(self.counter_rotation, bool):
            raise InvalidInputError(f"counter_rotation: expected True or False, got {self.counter_rotation!r}.")

    def memory(self, rows: int) -> Memory:
        """h(n-1), zero at the start, of shape (B, n), and the angles of the last step, of shape (B, 2)."""
        return np.zeros((rows, self.problem.model.joints)), np.full((rows, 2), np.nan)

    @staticmethod
    def angles(state: Memory) -> Angles:
        """The angles of both rotations in the call that returned a state."""
        angles = state[3]
        return Angles(angles[:, 0].copy(), angles[:, 1].copy())

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """The angles of both rotations in [rad], see :class:`Angles`, as ``angle_counter_rotation`` and so on."""
        return {f"angle_{name}": angle for name, angle in self.angles(state)._asdict().items()}

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        task = self.problem.task
        rows, n = batch.q.shape
        pull, angles = memory[0].copy(), np.empty((rows, 2))
        goal, status = np.empty((rows, n)), np.empty(rows, dtype=np.int64)
        iterate_rows(
            self.problem.model.chain,
            # The coordinates of `pose` are those of `matrix`, and the method knows no other error than a difference.
            task_kernels.MATRIX if task.kind == task_kernels.POSE else task.kind,
            *self._weights,
            self.counter_rotation,
            (self.r_a, self.lambda_a, self.epsa, self.q_pp_max),
            self.tolerance,
            batch.q,
            batch.pose,
            np.ascontiguousarray(batch.nominal[:, 0]),
            pull,
            goal,
            angles,
            status,
        )
        qdot = (goal - batch.q) / self.problem.dt
        return Solution(qdot, (pull, angles), status, np.ones(rows, dtype=np.int64))

    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """One Jacobian of the model, one measurement, nothing inverted."""
        return 0, 1, 0, 1


@kernel
def iterate_rows(
    chain, kind, task_weights, joint_weights, counter, rule, tolerance, q, pose, target, pull, goal, angles, status
):
    """One inner iteration, row by row.

    Args:
        chain: The model of the arm.
        kind: The kind of task coordinates.
        task_weights: The diagonal of ℱ. Shape (m,).
        joint_weights: The diagonal of 𝒲. Shape (n,).
        counter: Whether 𝒩 is applied.
        rule: R_a, λ_a, ``epsa`` and ``q_pp_max``.
        tolerance: ‖xᴺ - f‖ up to which the iteration has converged.
        q: Joint coordinates. Shape (B, n).
        pose: Measured task coordinates f. Shape (B, m).
        target: Nominal task coordinates xᴺ. Shape (B, m).
        pull: h(n-1), replaced by h(n). Shape (B, n).
        goal: Receives the next joint coordinates. Shape (B, n).
        angles: Receives the angles of both rotations. Shape (B, 2).
        status: Receives values of :class:`Status`. Shape (B,).
    """
    n, m = q.shape[1], pose.shape[1]
    rotation, position = np.empty((3, 3)), np.empty(3)
    geometric, jacobian = np.empty((6, n)), np.empty((m, n))
    error, h, realized, desired = np.empty(m), np.empty(n), np.empty(n), np.empty(n)
    e_a, e_b, extended = np.empty(n), np.empty(n), np.empty((3, n + 1))
    for row in range(q.shape[0]):
        forward_and_jacobian(chain, q[row], rotation, position, geometric)
        task_kernels.jacobian(kind, rotation, geometric, jacobian)
        for i in range(m):
            error[i] = target[row, i] - pose[row, i]
        _transposed(jacobian, task_weights, error, h)
        _transposed(jacobian, task_weights, pose[row], realized)
        _transposed(jacobian, task_weights, target[row], desired)
        angles[row, 0] = 0.0
        if counter:
            angles[row, 0] = plane(h, pull[row], e_a, e_b)
            turn(e_a, e_b, angles[row, 0], realized)
            turn(e_a, e_b, angles[row, 0], desired)
        for j in range(n):
            pull[row, j] = h[j]
            realized[j] *= joint_weights[j]
            desired[j] *= joint_weights[j]
        goal[row] = q[row]
        angles[row, 1] = adaptive_deform(realized, q[row], desired, rule, extended, goal[row])
        if math.isnan(angles[row, 1]):
            status[row] = _NO_ROTATION
        else:
            status[row] = _CONVERGED if math.sqrt(dot(error, error)) <= tolerance else _LIMIT


@kernel
def _transposed(jacobian, weights, vector, out):
    """J̃ᵀ ℱ times a vector: shapes (m, n), (m,), (m,), (n,)."""
    out[:] = 0.0
    for i in range(vector.shape[0]):
        weighted = weights[i] * vector[i]
        for j in range(out.shape[0]):
            out[j] += jacobian[i, j] * weighted


def _checked_weights(name: str, value: float | Sequence[float], size: int) -> FloatArray:
    weights = per_joint(name, value, size)
    if (weights <= 0.0).any() or (weights > 1.0).any():
        raise InvalidInputError(f"{name}: expected numbers above 0 and at most 1, got {value!r}.")
    return weights
