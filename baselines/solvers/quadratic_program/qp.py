"""The quadratic program: at each step the joint velocity that serves the task best within all limits."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar

import numpy as np

from baselines.solvers.quadratic_program.among_bodies import qp_step_among
from baselines.solvers.quadratic_program.base import VelocityProgram
from baselines.solvers.quadratic_program.box_minimum import box_minimum
from baselines.solvers.quadratic_program.program import held_back, row_program
from baselines.solvers.resolved_rate.base import APPLIED, task_motion
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.jit import kernel
from ikgym.validation import Bounds, Flag

LIMIT, SATURATED = int(Status.ITERATION_LIMIT), int(Status.SATURATED)


@kernel
def qp_step(model, numbers, batch, solution):
    """One step of :class:`QuadraticProgram`; see :class:`CompiledPolicy` for the arguments."""
    jacobian, motion, error = task_motion(model, batch, solution.memory)
    q, pull, (qdot, _, status, iterations) = batch.q, numbers.pull, solution
    n, size = q.shape[1], q.shape[1] + numbers.task_scaling
    hessian, linear, lower, upper = np.empty((size, size)), np.empty(size), np.zeros(size), np.zeros(size)
    preferred, x = np.empty(n), np.empty(size)
    for row in range(q.shape[0]):
        for j in range(n):
            preferred[j] = pull[0, j] * (pull[1, j] - q[row, j])
        jac, shift = jacobian[row], motion[row]
        parts = hessian, linear, lower, upper
        weight = row_program(
            model, numbers, q[row], batch.qdot[row], batch.change[row], jac, shift, error[row], preferred, parts
        )
        iterations[row], found = box_minimum(hessian, linear, lower, upper, x)
        for j in range(n):
            qdot[row, j] = x[j]
        status[row] = APPLIED if found else LIMIT
        if found and held_back(jac, shift, weight, numbers.weights, preferred, qdot[row], lower, upper, False):
            status[row] = SATURATED


@dataclasses.dataclass(frozen=True, eq=False)
class QuadraticProgram(VelocityProgram):
    """Minimises task error and joint motion under the limits of position, velocity and acceleration, at each step.

    The joint velocity is the minimum of ‖J q̇ Δt − Δx‖² + ρ ‖q̇ − z‖²_W, where ‖y‖²_W = Σ w_j y_j² and z leads to a
    posture. All limits are bounds of q̇, see :func:`velocity_box`: those of velocity, of the change of the velocity, and
    the velocity towards a stop from which the joint can still brake. The program in n variables with bounds is solved
    by an active set, exactly (:func:`box_minimum`).

    ρ = damping · mean ‖J_j Δt‖² / w_j + lm_damping · ‖e‖² / v², with the columns J_j, the weights w_j of the joints,
    the present error e and the largest joint velocity v: numbers that suit arms of any size. The second part is the
    damping of Levenberg and Marquardt (Sugihara 2011), next to nothing on the path; without it an arm that was led out
    of its reach swings through the stretched posture, and may come back with its elbow bent the other way.

    z is K (q* − q) without what would move the task, at most half of the joint motion that the reference asks for, in
    the norm of W: the posture is approached while the arm moves along its path, at both ends of which z vanishes. It
    takes at most 0.15 of the velocity limit of a slow joint, which the task needs.

    A smaller fraction of the error is corrected where the joints could not brake in time once it
    is gone. Without that an arm with acceleration limits swings about a reference that it has lost.

    With `task_scaling` the task shift is scaled by an s between 0 and 1: ‖J q̇ Δt − s Δx‖² + w (1 − s)² ‖Δx‖² +
    w ρ ‖q̇ − z‖²_W is minimised over q̇ and s, with w = 0.01, so that direction comes before length, and length before
    joint motion. Where the bounds allow s Δx, the motion leaves its line by (1 − s) ‖Δx‖ / 10 at most, mostly by much
    less. The price is singularities, where the arm may rest, or its joints drift.

    Such programs are the standard of differential inverse kinematics; with these limits in Flacco, De Luca and
    Khatib 2015 and in Pink. The status is ``saturated`` where a joint is at a bound and the task error that is left
    weighs more than the motion.

    Where bodies matter, each pair of them nearer than d* = `influence` has a row ∇dᵀ q̇ >= −v: a velocity damper
    (Faverjon and Tournassoud 1987). v is the speed from which the pair can still come to rest at `clearance`, with half
    of the acceleration limits, and at most a quarter of the way to it in one step; 10/s of it where the joints can give
    way without the task. Bodies of the arm are looked at from a third of d* on. Obstacles are where they will be
    after the step. The program is solved by a dual active set, exactly (:func:`row_minimum`). Where no joint velocity
    within the limits has all rows, all v are raised by the same amount, the smallest that will do: the limits of the
    joints are physical, and hold. z also leads away from near bodies, aside from the task (:func:`keep_clear`), and to
    the posture the less, the nearer it is. Only velocities of the next step are weighed, so that the arm may run into a
    dead end.

    Args:
        problem: The scenario as the policy knows it, with the limits of the model.
        gain: Fraction of the error corrected per step; see :class:`ResolvedRate`.
        damping, lm_damping, secondary_gain, posture, braking_share, rotation_weight, joint_weights: See
            :class:`VelocityProgram`.
        task_scaling: Whether to keep the direction of the task velocity.
        clearance: Distance that bodies keep from each other and from obstacles, in [m]. At least 0.
        influence: Distance d* from which on they are slowed down, in [m]. Above `clearance`.
        repulsion: K of the joint motion away from near bodies, in [1/s], at least 0 and below 2/Δt.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    task_scaling: Flag = False
    clearance: Annotated[float, Bounds(at_least=0.0)] = 0.005
    influence: Annotated[float, Bounds(above=0.0)] = 0.2
    repulsion: Annotated[float, Bounds(at_least=0.0)] = 10.0

    name: ClassVar[str] = "qp"
    step, step_among = qp_step, qp_step_among

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.among_bodies:
            self.check_secondary_gain(self.repulsion, "repulsion")
        if self.influence <= self.clearance:
            raise InvalidInputError(
                f"influence: expected a number above the clearance of {self.clearance:g} m, got {self.influence:g}."
            )
