"""Saturation in the null space: joints at their limits drop out, and the others make up for them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np

from baselines.policy.compiled import derived
from baselines.policy_kernels import JERK
from baselines.solvers.quadratic_program.program import curvature, feedback_share, motion_weight
from baselines.solvers.quadratic_program.velocity_box import calm_gain, smooth_box
from baselines.solvers.resolved_rate.base import APPLIED, ResolvedRate, task_motion
from baselines.status import Status
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.limits import CHANGE, FASTEST
from ikgym.kernels.linear_algebra import cholesky, singular_values, solve_by_singular_values
from ikgym.validation import Bounds, FloatArray, read_only

SATURATED = int(Status.SATURATED)
NONE = -1
# Singular values below this share of the length of J, all of its elements together, are rounding.
ROUNDING = 1e-12


@inner
def saturate(jacobian, shift, damping, lower, upper, smooth, qdot):
    """The algorithm for one arm: J (e, n), the task velocity (e,), bounds (n,); ``qdot`` (n,) receives the velocities.

    With a limited jerk (``smooth``), bounds are narrow and often leave out 0. Where they leave no share of the task
    velocity, the joint velocities for all of it are cut to them: those for none of it would brake, and lose the task.

    Returns:
        The number of decompositions, and whether the task velocity was scaled down.
    """
    e, n = jacobian.shape
    free, fixed, rest = np.ones(n, np.bool_), np.zeros(n), np.empty(e)
    columns, left, squares = np.empty((n, e)), np.empty((e, e)), np.empty(e)
    # The joint velocity is s · along + base.
    along, base, best, full = np.empty(n), np.empty(n), -1.0, 0
    size = np.sum(jacobian * jacobian)
    square, smallest = damping * size / n, ROUNDING * ROUNDING * size
    for made in range(1, n + 2):
        for a in range(e):
            rest[a] = 0.0
            for j in range(n):
                columns[j, a] = jacobian[a, j] if free[j] else 0.0
                rest[a] -= jacobian[a, j] * fixed[j]
        singular_values(columns, left, squares)
        rank = np.sum(squares > max(square, smallest))
        full = rank if made == 1 else full
        if rank < full:
            break
        solve_by_singular_values(columns, left, squares, square, smallest, shift, along)
        solve_by_singular_values(columns, left, squares, square, smallest, rest, base)
        base += fixed
        scale, critical = scaling(along, base, lower, upper)
        if scale > best:
            best = scale
            share = 1.0 if smooth and scale == 0.0 else scale
            for j in range(n):
                qdot[j] = min(max(share * along[j] + base[j], lower[j]), upper[j])
        if critical == NONE:
            break
        free[critical] = False
        fixed[critical] = upper[critical] if along[critical] + base[critical] > upper[critical] else lower[critical]
    return made, best < 1.0


@kernel
def scaling(along, base, lower, upper):
    """The largest s from 0 to 1 at which s · along + base is within bounds, 0 if there is none.

    Returns:
        s, and the joint beyond its bounds at s = 1 that allows the least; NONE where all are within.
    """
    least, most, critical, allowed = 0.0, 1.0, NONE, 0.0
    for j in range(along.shape[0]):
        first, last = 0.0, 1.0
        if along[j] > 0.0:
            first, last = (lower[j] - base[j]) / along[j], (upper[j] - base[j]) / along[j]
        elif along[j] < 0.0:
            first, last = (upper[j] - base[j]) / along[j], (lower[j] - base[j]) / along[j]
        elif not lower[j] <= base[j] <= upper[j]:
            last = -1.0
        least, most = max(least, first), min(most, last)
        if not lower[j] <= along[j] + base[j] <= upper[j] and (critical == NONE or last < allowed):
            critical, allowed = j, last
    if critical == NONE:
        return 1.0, NONE
    return (most if least <= most else 0.0), critical


@kernel
def sns_step(model, numbers, batch, solution):
    """One step of :class:`SaturationInNullSpace`; see :class:`CompiledPolicy` for the arguments."""
    jacobian, shift, error = task_motion(model, batch, solution.memory)
    error *= calm_gain(model.limits, numbers.gain)
    (q, last), (qdot, _, status, iterations), limits, dt = (batch.q, batch.qdot), solution, model.limits, model.dt
    reach, n, smooth = numbers.reach, q.shape[1], np.min(limits[JERK]) < math.inf
    lower, upper, equal, hessian = np.empty(n), np.empty(n), np.ones(n), np.empty((n, n))
    for row in range(q.shape[0]):
        smooth_box(limits, dt, q[row], last[row], batch.change[row], lower, upper)
        jac = jacobian[row]
        jac *= dt * reach
        lower /= reach
        upper /= reach
        if numbers.braking > 0.0:
            weight = motion_weight(jac, error[row], numbers.damping, 0.0, equal, limits[FASTEST])
            curvature(jac, weight, equal, hessian)
            if cholesky(hessian):
                part = calm_gain(limits, 1.0) * numbers.braking
                error[row] *= feedback_share(hessian, jac, error[row], part, limits[CHANGE] / reach)
        shift[row] += error[row]
        iterations[row], scaled = saturate(jac, shift[row], numbers.damping, lower, upper, smooth, qdot[row])
        qdot[row] *= reach
        status[row] = SATURATED if scaled else APPLIED


@dataclasses.dataclass(frozen=True, eq=False)
class SaturationInNullSpace(ResolvedRate):
    """The smallest joint velocity that makes the task velocity; joints beyond their limits are set to them, one by one.

    Each time the joint that would have to be slowed down the most is set to its bound, and the others make the rest
    of the task: q̇ = q̇_N + (J W)⁺ (ẋ − J q̇_N). Where too few joints are left, the task velocity is scaled
    down instead, by the largest factor that was met on the way: the basic algorithm at velocity level (Flacco, De Luca
    and Khatib 2012, algorithm 1; 2015, section III), with the bounds of :func:`velocity_box`. It keeps the direction of
    the task velocity, and need not find the largest factor, unlike :class:`QuadraticProgram` with `task_scaling`. The
    status is ``saturated`` where the task velocity was scaled down.

    The pseudoinverse is damped, since the arm would stop in every singularity, the joints are weighted, and errors are
    corrected no faster than the joints can brake; none of these is part of the source. A task that has lost rank in all
    joints is scaled only where it loses more.

    Args:
        problem: The scenario as the policy knows it, with the limits of the model.
        gain: Fraction of the error corrected per step; see :class:`ResolvedRate`.
        damping: Added to the squared singular values of J W^-½, as a share of the mean of ‖J_j‖² / w_j over the joints
            j. Smaller squares count as lost rank. At least 0; then those below rounding do, and are left out.
        joint_weights, braking_share: See :class:`VelocityProgram`.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    damping: Annotated[float, Bounds(at_least=0.0)] = 3e-5
    joint_weights: float | Sequence[float] | None = None
    braking_share: Annotated[float, Bounds(at_least=0.0, at_most=1.0)] = 0.5
    #: See :class:`VelocityProgram`.
    braking: float = derived()
    #: Roots of the inverse weights of the joints. Shape (n,).
    reach: FloatArray = derived()

    name: ClassVar[str] = "sns"
    keeps_acceleration: ClassVar[bool] = True
    keeps_jerk: ClassVar[bool] = True
    step = sns_step

    def __post_init__(self) -> None:
        super().__post_init__()
        brakes = np.isfinite(self.problem.model.acceleration_limit).any()
        reach = read_only(1.0 / np.sqrt(self.weights_of(self.joint_weights)))
        braking = self.braking_share if brakes else 0.0
        self._settle(reach=reach, braking=braking)
