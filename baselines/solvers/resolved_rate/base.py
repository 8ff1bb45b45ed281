"""Resolved rate: what all solvers share that answer a desired task velocity by one linear step."""

from __future__ import annotations

import abc
import dataclasses
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Memory
from baselines.policy.compiled import CompiledPolicy
from baselines.policy_kernels import answer_parts, as_rows, cut_rows, scale_rows
from baselines.solvers.arm_task import (
    add_feedback,
    arm_task_of,
    joint_limits_of,
    motion_and_error,
    period_of,
    plain_arm_task,
    pose_arrays,
)
from baselines.status import Status
from ikgym import task_kernels
from ikgym.exceptions import InvalidInputError
from ikgym.jit import inlined
from ikgym.kinematics import forward_and_jacobian
from ikgym.validation import FloatArray, known_name, number

APPLIED, DEFICIENT = int(Status.APPLIED), int(Status.RANK_DEFICIENT)
SATURATIONS = ("clip", "scale")


class NominalMemory(NamedTuple):
    """What is remembered from the step before.

    Attributes:
        nominal: X^N(k), the nominal task coordinates that the step before was to reach. Shape (B, m).
        known: Whether there was a step before. Shape (B,).
    """

    nominal: FloatArray
    known: npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True, eq=False)
class TaskFeedback(CompiledPolicy, abc.ABC):
    """Asks for the nominal motion of the next step and for a share of the present error, and remembers the former.

    The shift asked for in one step is ``Δx = (X^N(k+1) - X^N(k)) + gain (X^N(k) - x(k))``, where X^N(k) is
    remembered from the step before (at the first step it is taken to be the measured pose). What becomes of it is left
    to subclasses.

    Args:
        problem: What the policy is told of the scenario.
        gain: Share of the present error that is taken back in one step, K Δt with the feedback gain K in [1/s].
            Above 0; 1 is deadbeat control, 2 the limit of stability. Where commands take effect d steps late, the
            limit is 2 sin(π / (2 (2 d + 1))): 0.62 at 2 steps, 0.13 at 12.

    Raises:
        InvalidInputError: The gain is not between 0 and 2.
    """

    gain: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", number("gain", self.gain, above=0.0))
        if self.gain >= 2.0:
            raise InvalidInputError(f"gain: expected a number above 0 and below 2, got {self.gain:g}.")

    def checked_secondary_gain(self, gain: float) -> float:
        """The gain of a secondary objective in [1/s].

        Raises:
            InvalidInputError: It is not at least 0 and below 2/Δt.
        """
        checked = number("secondary_gain", gain, at_least=0.0)
        if checked * self.problem.dt >= 2.0:
            limit = 2.0 / self.problem.dt
            raise InvalidInputError(f"secondary_gain: expected a number below 2/Δt = {limit:g}, got {checked:g}.")
        return checked

    def memory(self, rows: int) -> Memory:
        """A :class:`NominalMemory` without a step before."""
        return NominalMemory(np.zeros((rows, self.problem.task.size)), np.zeros(rows, dtype=np.bool_))

    def constants(self) -> tuple[Any, ...]:
        """See :meth:`CompiledPolicy.constants`: arm and task, and the gain, then the numbers of the formula."""
        return plain_arm_task(self.problem), self.gain, *self.numbers()

    @abc.abstractmethod
    def numbers(self) -> tuple[Any, ...]:
        """What the formula needs to know besides."""

    @property
    def full_rank(self) -> int:
        """The rank that the task Jacobian has where nothing is lost: redundant coordinates add none."""
        return min(self.problem.task.error_size, self.problem.model.joints, 6)


@dataclasses.dataclass(frozen=True, eq=False)
class ResolvedRate(TaskFeedback, abc.ABC):
    """Follows the nominal motion of the next step, and takes back a share of the present error; see the base.

    The task shift is turned into ``q̇ Δt`` with the task Jacobian of the model at q(k), by a subclass.

    Args:
        problem: What the policy is told of the scenario.
        gain: Share of the present error that is taken back in one step; see :class:`TaskFeedback`.
        saturation: What is done about joint velocities beyond their limits: ``clip`` cuts each joint to its own,
            ``scale`` slows down all of them alike, which keeps the direction of the task velocity. That is not the
            default, since a single slow joint, such as the torso of TIAGo, holds up all others then.

    Raises:
        InvalidInputError: The gain is not between 0 and 2.
        UnknownNameError: There is no such saturation.
    """

    saturation: str = "clip"

    def __post_init__(self) -> None:
        super().__post_init__()
        known_name("saturation", self.saturation, SATURATIONS)

    def constants(self) -> tuple[Any, ...]:
        """See :meth:`TaskFeedback.constants`; behind the gain, whether all joints are slowed down alike."""
        arm_task, gain, *numbers = super().constants()
        return arm_task, gain, self.saturation == "scale", *numbers

    @abc.abstractmethod
    def invert(self, jacobian: FloatArray, shift: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """The joint shifts for task shifts.

        Args:
            jacobian: Task Jacobians. Shape (B, e, n).
            shift: Task shifts. Shape (B, e).

        Returns:
            Joint shifts in [rad] or [m], of shape (B, n), and values of :class:`Status`, of shape (B,).
        """


@inlined
def asked(arm_task, gain, q, pose, nominal, before, known, answer):
    """Begins a kernel of one iteration: what is asked for, and where the answer goes.

    Args:
        arm_task: See :func:`plain_arm_task`.
        gain: Share of the present error to take back.
        q: Joint coordinates in [rad] or [m]. Shape (B n,).
        pose: Measured task coordinates. Shape (B m,).
        nominal: Nominal task coordinates ahead. Shape (B p, m).
        before: X^N(k), where known; becomes X^N(k+1). Shape (B, m).
        known: Whether there was a step before; becomes True. Shape (B,).
        answer: See :class:`CompiledPolicy`.

    Returns:
        Joint coordinates (B, n), task Jacobians (B, e, n), the task shifts asked for (B, e), and the answer's parts:
        joint shifts (B, n), status and iterations (B,), to be filled in.
    """
    q, jacobian, shift, error, parts = asked_apart(arm_task, q, pose, nominal, before, known, answer)
    for row in range(shift.shape[0]):
        add_feedback(gain, error[row], shift[row])
    return q, jacobian, shift, parts


@inlined
def asked_apart(arm_task, q, pose, nominal, before, known, answer):
    """The same with X^N(k+1) - X^N(k) and X^N(k) - x(k) in place of the task shifts, of shapes (B, e)."""
    chain, kind = arm_task_of(arm_task)
    q, pose, nominal = as_rows(int(arm_task[0]), q, pose, nominal)
    rows, n = q.shape
    size = task_kernels.error_size(kind, pose.shape[1])
    jacobian, motion, error = np.empty((rows, size, n)), np.empty((rows, size)), np.empty((rows, size))
    rotation, position, geometric, _ = pose_arrays(n, pose.shape[1])
    for row in range(rows):
        forward_and_jacobian(chain, q[row], rotation, position, geometric)
        task_kernels.jacobian(kind, rotation, geometric, jacobian[row])
        present = before[row] if known[row] else pose[row]
        motion_and_error(kind, pose[row], nominal[row, 0], present, motion[row], error[row])
        before[row] = nominal[row, 0]
        known[row] = True
    return q, jacobian, motion, error, answer_parts(answer, rows, n)


@inlined
def answered(arm_task, scaling, answer, action):
    """Ends a kernel of one iteration: joint shifts become velocities and actions.

    Args:
        arm_task: See :func:`plain_arm_task`.
        scaling: Whether joints beyond their velocity limits slow down all others, see :func:`scale_rows`.
        answer: Joint shifts (B, n), which become joint velocities; status, and iterations, which become 1. Shape (B,).
        action: Receives the actions. Shape (B n,).
    """
    (dt, limit), (qdot, status, iterations) = period_of(arm_task), answer
    for row in range(qdot.shape[0]):
        iterations[row] = 1
        for j in range(qdot.shape[1]):
            qdot[row, j] /= dt
    if scaling:
        scale_rows(qdot, joint_limits_of(arm_task)[2], status)
    return cut_rows(qdot, limit, action.reshape(qdot.shape), status)


@inlined
def say_deficient(deficient, status):
    """Statuses of rows by whether the Jacobian had lost rank. Shapes (B,)."""
    for row in range(status.shape[0]):
        status[row] = DEFICIENT if deficient[row] else APPLIED


def status_of(rank_deficient: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Statuses of rows by whether the Jacobian had lost rank. Shapes (B,)."""
    return np.where(rank_deficient, DEFICIENT, APPLIED)
