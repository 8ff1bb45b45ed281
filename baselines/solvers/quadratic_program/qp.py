"""The quadratic program: at each step the joint velocity that serves the task best within all limits."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from baselines.policy.parameters import parameter
from baselines.solvers.quadratic_program.base import QuadraticProgramNumbers, VelocityProgram
from baselines.solvers.quadratic_program.box_minimum import box_minimum
from baselines.solvers.quadratic_program.program import (
    SCALING_WEIGHT,
    curvature,
    feedback_share,
    goal,
    goal_to_scale,
    held_back,
    motion_weight,
    weigh_rotation,
)
from baselines.solvers.quadratic_program.velocity_box import velocity_box
from baselines.solvers.resolved_rate.base import APPLIED, task_motion
from baselines.status import Status
from ikgym.kernels.jit import kernel
from ikgym.kernels.limits import CHANGE, FASTEST
from ikgym.validation import flag

LIMIT, SATURATED = int(Status.ITERATION_LIMIT), int(Status.SATURATED)


@kernel
def qp_step(model, numbers, seen, memory, answer):
    """One step of :class:`QuadraticProgram`; see :class:`CompiledPolicy` for the arguments."""
    jacobian, motion, error = task_motion(model.chain, model.kind, seen, memory)
    gain, damping, lm_damping, braking_share, rotation_weight, scaling, pull, limits = numbers
    (q, last), dt = (seen.q, seen.qdot), model.dt
    qdot, status, iterations = answer
    n, size = q.shape[1], q.shape[1] + scaling
    hessian, linear, lower, upper = np.empty((size, size)), np.empty(size), np.zeros(size), np.zeros(size)
    preferred, x = np.empty(n), np.empty(size)
    for row in range(q.shape[0]):
        velocity_box(limits, dt, q[row], last[row], lower, upper)
        for j in range(n):
            preferred[j] = pull[0, j] * (pull[1, j] - q[row, j])
        jac, shift, missing = jacobian[row], motion[row], error[row]
        if rotation_weight != 1.0:
            weigh_rotation(model.kind, rotation_weight, jac, shift, missing)
        jac *= dt
        missing *= gain
        weight = motion_weight(jac, missing, damping, lm_damping, limits[FASTEST])
        weight *= SCALING_WEIGHT if scaling else 1.0
        curvature(jac, weight, hessian)
        if braking_share > 0.0:
            missing *= feedback_share(hessian, jac, missing, braking_share * limits[CHANGE])
        shift += missing
        if scaling:
            upper[n] = goal_to_scale(jac, shift, weight, preferred, hessian, linear)
        else:
            goal(jac, shift, weight, preferred, linear)
        iterations[row], found = box_minimum(hessian, linear, lower, upper, x)
        for j in range(n):
            qdot[row, j] = x[j]
        status[row] = APPLIED if found else LIMIT
        if found and held_back(jac, shift, weight, preferred, qdot[row], lower, upper):
            status[row] = SATURATED


@dataclasses.dataclass(frozen=True, eq=False)
class QuadraticProgram(VelocityProgram):
    """Minimises task error and joint motion under the limits of position, velocity and acceleration, at each step.

    The joint velocity is the minimum of ‖J q̇ Δt − Δx‖² + ρ ‖q̇ − z‖², where z = K (q* − q) leads to a posture. All
    limits are bounds of q̇, see :func:`velocity_box`: those of velocity, of the change of the velocity, and the velocity
    towards a stop from which the joint can still brake. The program in n variables with bounds is solved by an active
    set, exactly (:func:`box_minimum`).

    ρ = damping · mean ‖J_j Δt‖² + lm_damping · ‖e‖² / v², with the columns J_j, the present error e and the largest
    joint velocity v: numbers that suit arms of any size. The second part is the damping of Levenberg and Marquardt
    (Sugihara 2011), next to nothing on the path; without it an arm that was led out of its reach swings through the
    stretched posture, and may come back with its elbow bent the other way.

    The share of the present error that is taken back is made smaller where the joints could not brake in time once it
    is gone. Without that an arm with acceleration limits swings about a reference that it has lost.

    With `task_scaling` the task shift is scaled by an s between 0 and 1: ‖J q̇ Δt − s Δx‖² + w (1 − s)² ‖Δx‖² +
    w ρ ‖q̇ − z‖² is minimised over q̇ and s, with w = 0.01, so that direction comes before length, and length before
    joint motion. Where the bounds allow s Δx, what is made is off its line by (1 − s) ‖Δx‖ / 10 at most, mostly by much
    less. The price is singularities, where the arm may stand still or lead its joints astray.

    Such programs are the standard of differential inverse kinematics; with these limits in Flacco, De Luca and
    Khatib 2015 and in Pink. The status is ``saturated`` where a joint stands at a bound and the task error that is left
    weighs more than the motion.

    Args:
        problem: The scenario as the policy knows it, with the limits of the model.
        gain: Share of the present error that is taken back in one step; see :class:`TaskFeedback`.
        damping, lm_damping, secondary_gain, posture, braking_share, rotation_weight: See :class:`VelocityProgram`.
        task_scaling: Whether to keep the direction of the task velocity.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    task_scaling: bool = parameter(False, flag)

    name: ClassVar[str] = "qp"
    step = qp_step

    def numbers(self) -> QuadraticProgramNumbers:
        """See :meth:`CompiledPolicy.numbers`."""
        return self.program_numbers(scaling=self.task_scaling)
