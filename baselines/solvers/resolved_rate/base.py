"""Resolved rate: the base of all solvers that answer a desired task velocity at each step."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Memory
from baselines.policy.compiled import CompiledPolicy
from baselines.status import Status
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inlined, inner, uncounted
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.validation import Bounds, FloatArray, per_joint, read_only

APPLIED, DEFICIENT = int(Status.APPLIED), int(Status.RANK_DEFICIENT)
# Joints count as slow below this share of the largest velocity, and how much costlier they are by default, see
# :func:`velocity_weights`. On paths of arms with slow torsos a power of 1 leaves them at their limits, and with 2 the
# other joints come near to singularities.
SLOW, SLOWNESS = 1.0 / 3.0, 1.1


class NominalMemory(NamedTuple):
    """Memory of the previous step.

    Attributes:
        nominal: X^N(k), the nominal task coordinates that the step before was to reach. Shape (B, m).
        known: Whether there was a step before. Shape (B,).
    """

    nominal: FloatArray
    known: npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True, eq=False)
class ResolvedRate(CompiledPolicy, abc.ABC):
    """Asks for the nominal motion of the next step and for a share of the present error, and remembers the former.

    The shift asked for in one step is ``Δx = (X^N(k+1) - X^N(k)) + gain (X^N(k) - x(k))``, where X^N(k) is
    remembered from the step before (at the first step it is taken to be the measured pose). Subclasses turn it into
    ``q̇ Δt`` with the task Jacobian of the model at q(k). Joint velocities beyond their limits are cut joint by joint.

    Args:
        problem: The scenario as the policy knows it.
        gain: Fraction of the error corrected per step, K Δt with the feedback gain K in [1/s].
            Above 0; 1 is deadbeat control, 2 the limit of stability. Where commands take effect d steps late, the
            limit is 2 sin(π / (2 (2 d + 1))): 0.62 at 2 steps, 0.13 at 12.

    Raises:
        InvalidInputError: The gain is not between 0 and 2.
    """

    gain: Annotated[float, Bounds(above=0.0, below=2.0)] = 1.0

    def check_secondary_gain(self, gain: float, name: str = "secondary_gain") -> None:
        """Checks the gain of a secondary objective in [1/s] against the time step.

        Raises:
            InvalidInputError: It is not below 2/Δt.
        """
        if gain * self.problem.dt >= 2.0:
            limit = 2.0 / self.problem.dt
            raise InvalidInputError(f"{name}: expected a number below 2/Δt = {limit:g}, got {gain:g}.")

    def weights_of(self, joint_weights: float | Sequence[float] | None) -> FloatArray:
        """The parameter `joint_weights` as an array; by the velocity limits if left out. Shape (n,).

        Raises:
            InvalidInputError: See :func:`check_weights`.
        """
        usual = velocity_weights(self.problem.model, self.problem.largest_qdot, SLOWNESS, SLOW)
        given = usual if joint_weights is None else joint_weights
        return check_weights("joint_weights", given, self.problem.model.joints)

    def memory(self, rows: int) -> Memory:
        """A :class:`NominalMemory` without a step before."""
        return NominalMemory(np.zeros((rows, self.problem.task.size)), np.zeros(rows, dtype=np.bool_))


def velocity_weights(arm: Arm, fastest: FloatArray, power: float, slow: float = 1.0) -> float | tuple[float, ...]:
    """Weights of the joints by their largest velocities v, (v_max / v)^power; 1 for all where the arm has no limits.

    Args:
        arm: The arm.
        fastest: v in [rad/s] or [m/s]. Shape (n,).
        power: 2 measures joint motions in terms of the largest velocities, 0 weighs all joints alike.
        slow: Joints with at least this share of v_max weigh 1.
    """
    if not np.isfinite(arm.velocity_limit).any():
        return 1.0
    ratio = fastest.max() / fastest
    return tuple(np.where(slow * ratio > 1.0, ratio**power, 1.0).tolist())


def check_weights(name: str, weights: float | Sequence[float], joints: int) -> FloatArray:
    """Weights of the joints. Shape (n,).

    Raises:
        InvalidInputError: One is not above 0, or they are too few or too many.
    """
    array = per_joint(name, weights, joints)
    if not (array > 0.0).all():
        raise InvalidInputError(f"{name}: expected numbers above 0, got {array.tolist()}.")
    return array


def relative_weights(name: str, weights: float | Sequence[float], joints: int) -> FloatArray:
    """The same in units of the smallest one, read-only. Shape (n,)."""
    array = check_weights(name, weights, joints)
    return read_only(array / array.min())


@inner
def task_motion(model, batch, memory):
    """Task Jacobians, the motion of the reference, and the present errors; the reference is remembered.

    Args:
        model: The :class:`Model`.
        batch: The observations, a :class:`Batch`.
        memory: The :class:`NominalMemory`, turned into the next one in place.

    Returns:
        J (B, e, n), X^N(k+1) - X^N(k) and X^N(k) - x(k), both of shape (B, e).
    """
    kind, q, pose, nominal, before, known = model.kind, batch.q, batch.pose, batch.nominal, memory.nominal, memory.known
    rows, n = q.shape
    size = task_kernels.error_size(kind, pose.shape[1])
    jacobian, motion, error = np.empty((rows, size, n)), np.empty((rows, size)), np.empty((rows, size))
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    for row in range(rows):
        forward_and_jacobian(model.chain, q[row], rotation, position, geometric)
        task_kernels.jacobian(kind, rotation, geometric, jacobian[row])
        present, target = before[row] if known[row] else pose[row], nominal[row, 0]
        task_kernels.error(kind, target, present, motion[row])
        task_kernels.error(kind, present, pose[row], error[row])
        for i in range(target.shape[0]):
            before[row, i] = target[i]
        known[row] = True
    return jacobian, motion, error


@inlined
def full_rank(jacobian):
    """The rank that task Jacobians (B, e, n) have where nothing is lost: redundant coordinates add none."""
    return min(jacobian.shape[1], jacobian.shape[2], 6)


@uncounted
def add_feedback(gain, error, shift):
    """Adds a share of the errors to task shifts, both of shape (B, e)."""
    for row in range(shift.shape[0]):
        for i in range(shift.shape[1]):
            shift[row, i] += gain * error[row, i]


@uncounted
def to_velocity(model, solution):
    """Turns joint shifts into velocities; one iteration was made."""
    qdot, iterations = solution.qdot, solution.iterations
    for row in range(qdot.shape[0]):
        iterations[row] = 1
        for j in range(qdot.shape[1]):
            qdot[row, j] /= model.dt


@uncounted
def set_status(deficient, status):
    """Sets the statuses of rows by whether the Jacobian has lost rank. Shapes (B,)."""
    for row in range(status.shape[0]):
        status[row] = DEFICIENT if deficient[row] else APPLIED
