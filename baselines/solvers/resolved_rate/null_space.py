"""Resolved rate with a secondary objective in the null space of the task."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np

from baselines.policy.compiled import derived
from baselines.solvers.near_bodies import ROWS, bodies_of, near_distances, near_work, repel
from baselines.solvers.resolved_rate.base import APPLIED, add_feedback, full_rank, set_status, task_motion, to_velocity
from baselines.solvers.resolved_rate.dls import damped_rows
from baselines.solvers.resolved_rate.moore_penrose import MoorePenrose
from ikgym.arms import Arm
from ikgym.arms.limits import middle
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.linear_algebra import pseudoinverse_rows
from ikgym.validation import Bounds, FloatArray, as_given, one_of, per_joint, read_only

OBJECTIVES = ("posture", "joint_centring")


@inner
def task_rows(jacobian, velocity, out):
    """J q̇ row by row: shapes (B, e, n), (B, n), (B, e)."""
    for row in range(jacobian.shape[0]):
        for a in range(jacobian.shape[1]):
            total = 0.0
            for k in range(jacobian.shape[2]):
                total += jacobian[row, a, k] * velocity[row, k]
            out[row, a] = total


@kernel
def null_space_step_among(model, numbers, batch, solution):
    """One step of :class:`NullSpace` among bodies; see :class:`CompiledPolicy` for the arguments."""
    jacobian, shift, error = task_motion(model, batch, solution.memory)
    add_feedback(numbers.gain, error, shift)
    q, boxes, (shapes, checked) = batch.q, numbers.boxes, bodies_of(numbers.bodies)
    aim, distances, reaches, gradients = np.empty(q.shape), np.empty(ROWS), np.empty(ROWS), np.empty((ROWS, q.shape[1]))
    objective_rows(numbers, model.dt, q, aim)
    work = near_work(q.shape[1], shapes.links.shape[0])
    for row in range(q.shape[0]):
        around_it = shapes, checked, boxes[row % boxes.shape[0]]
        count = near_distances(model.chain, *around_it, q[row], numbers.influence, work, distances, reaches, gradients)
        repel(distances, reaches, gradients, count, model.dt * numbers.repulsion, aim[row])
    aimed_rows(numbers, aim, jacobian, shift, solution.qdot, solution.status)
    to_velocity(model, solution)


@kernel
def null_space_step(model, numbers, batch, solution):
    """One step of :class:`NullSpace`; see :class:`CompiledPolicy` for the arguments."""
    jacobian, shift, error = task_motion(model, batch, solution.memory)
    add_feedback(numbers.gain, error, shift)
    aim = np.empty(batch.q.shape)
    objective_rows(numbers, model.dt, batch.q, aim)
    aimed_rows(numbers, aim, jacobian, shift, solution.qdot, solution.status)
    to_velocity(model, solution)


@kernel
def aimed_rows(numbers, aim, jacobian, shift, out, status):
    """J⁺ Δx + (I - J⁺ J) Δt z row by row.

    Args:
        numbers: The fields of :class:`NullSpace`.
        aim: Secondary joint shifts Δt z. Shape (B, n).
        jacobian: Task Jacobians. Shape (B, e, n).
        shift: Task shifts. Shape (B, e).
        out: Receives the joint shifts. Shape (B, n).
        status: Receives values of :class:`Status`. Shape (B,).
    """
    tolerance, rank = numbers.rank_tolerance, full_rank(jacobian)
    disturbance, deficient = np.empty(shift.shape), np.empty(aim.shape[0], np.bool_)
    task_rows(jacobian, aim, disturbance)
    if numbers.damping == 0.0:  # with one pseudoinverse
        pseudoinverse_rows(jacobian, shift - disturbance, tolerance, rank, out, deficient)
        out += aim
        set_status(deficient, status)
        return
    taken_off = np.empty(aim.shape)
    damped_rows(jacobian, shift, numbers.damping, out)
    pseudoinverse_rows(jacobian, disturbance, tolerance, rank, taken_off, deficient)
    out += aim - taken_off
    status[:] = APPLIED


@inner
def objective_rows(numbers, dt, q, out):
    """Joint shifts Δt z of the secondary objective, row by row: the fields, Δt in [s], (B, n), (B, n)."""
    joint_gain, goal, gain = numbers.joint_gain, numbers.goal, dt * numbers.secondary_gain
    for row in range(q.shape[0]):
        for j in range(q.shape[1]):
            out[row, j] = joint_gain[j] * (goal[j] - q[row, j]) * gain


@dataclasses.dataclass(frozen=True, eq=False)
class NullSpace(MoorePenrose):
    """Follows a secondary objective in the null space of the task: q̇ = J⁺ ẋ + (I − J⁺ J) z (Liégeois 1977).

    Varga 2021 (section I, its references 10 to 12) and Khan 2020 name the method. The secondary objective
    gives a joint velocity z, of which only the part is used that moves no task coordinate:

    - ``posture``: z = K (q_posture − q).
    - ``joint_centring``: z = K (r_min / r)² (q_middle − q), joint by joint, with the ranges r between the limits
      and the smallest of them r_min; that is Liégeois's gradient, scaled so that K is the gain of the joint with
      the smallest range. Joints without two finite limits are left alone.

    Where bodies matter, z also leads away from near bodies, see :func:`repel`: an artificial potential (Khatib 1986)
    in the null space, as in Maciejewski and Klein 1985. Nothing keeps such an arm from touching something, least of all
    with its tool.

    The first part is Moore–Penrose, or damped least squares if there is a damping. J⁺ in the second part is never
    damped, or the task would be disturbed. An arm without redundancy is moved by the secondary objective in singular
    poses only, where the Jacobian has a null space.

    Args:
        problem: The scenario as the policy knows it.
        gain: Fraction of the error corrected per step; see :class:`ResolvedRate`.
        rank_tolerance: Singular values below this share of the largest count as zero. At least 0.
        objective: ``posture`` or ``joint_centring``. If left out, ``joint_centring`` where
            the model has joint limits and no posture is given, else ``posture``.
        secondary_gain: K in [1/s], at least 0 and below 2/Δt.
        posture: q_posture in [rad] or [m], 0 if left out; one number, or one a joint. For ``posture`` only.
        damping: λ of the first part, as in :class:`DampedLeastSquares`; 0 for Moore–Penrose.
        influence: Distance from which on bodies are led away, in [m]. Above 0.
        repulsion: K of that in [1/s], at least 0 and below 2/Δt.

    Raises:
        InvalidInputError: A number is out of its range, or the joints are to be centred and none of them has
            limits.
        UnknownNameError: There is no such objective.
    """

    objective: Annotated[str, one_of(OBJECTIVES)] | None = None
    secondary_gain: Annotated[float, Bounds(at_least=0.0)] = 1.0
    posture: float | Sequence[float] | None = None
    damping: Annotated[float, Bounds(at_least=0.0)] = 1e-3
    influence: Annotated[float, Bounds(above=0.0)] = 0.3
    repulsion: Annotated[float, Bounds(at_least=0.0)] = 10.0
    #: How strongly each joint moves to its goal, relative to K. Shape (n,).
    joint_gain: FloatArray = derived()
    #: The joints' goal, in [rad] or [m]. Shape (n,).
    goal: FloatArray = derived()

    name: ClassVar[str] = "null_space"
    step, step_among = null_space_step, null_space_step_among

    def __post_init__(self) -> None:
        super().__post_init__()
        model = self.problem.model
        default = "joint_centring" if self.posture is None and middle(model)[0].any() else "posture"
        objective = default if self.objective is None else self.objective
        given = 0.0 if self.posture is None else self.posture
        posture = per_joint("posture", given, model.joints)
        target, gains = _centre(model) if objective == "joint_centring" else (posture, np.ones(model.joints))
        self.check_secondary_gain(self.secondary_gain)
        if self.among_bodies:
            self.check_secondary_gain(self.repulsion, "repulsion")
        self._settle(objective=objective, posture=as_given(given, posture))
        self._settle(goal=read_only(target), joint_gain=read_only(gains))


def _centre(model: Arm) -> tuple[FloatArray, FloatArray]:
    """The middles between the limits and how strongly to go there, 0 for joints without limits; shapes (n,)."""
    limited, target = middle(model)
    if not limited.any():
        raise InvalidInputError(
            f"objective 'joint_centring': expected an arm with joint limits, {model.name!r} has none; "
            "objective 'posture' goes to joint coordinates of your choice."
        )
    gains, span = np.zeros(model.joints), (model.upper - model.lower)[limited]
    gains[limited] = (span.min() / span) ** 2
    return target, gains
