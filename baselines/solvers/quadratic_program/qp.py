"""The quadratic program: at each step the joint velocity that serves the task best within all limits."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from baselines.policy.parameters import parameter
from baselines.solvers.quadratic_program.box_minimum import box_minimum
from baselines.solvers.quadratic_program.limits import limits_with_braking
from baselines.solvers.quadratic_program.program import (
    SCALING_WEIGHT,
    curvature,
    feedback_share,
    goal,
    goal_to_scale,
    held_back,
    motion_weight,
)
from baselines.solvers.quadratic_program.velocity_box import velocity_box
from baselines.solvers.resolved_rate.base import APPLIED, TaskFeedback, task_motion
from baselines.status import Status
from ikgym.arms.limits import middle
from ikgym.kernels.jit import kernel
from ikgym.kernels.limits import CHANGE, FASTEST
from ikgym.validation import FloatArray, as_given, flag, number, per_joint, read_only

LIMIT, SATURATED = int(Status.ITERATION_LIMIT), int(Status.SATURATED)


class QuadraticProgramNumbers(NamedTuple):
    """The parameters of :class:`QuadraticProgram` as its kernel takes them.

    Attributes:
        gain: Share of the present error that is taken back in one step.
        damping: Weight of the joint motion as a share of that of the task.
        lm_damping: How much that grows with the error.
        braking_share: Share of the acceleration limit that the feedback reckons with; 0 if it does not.
        scaling: Whether the task shift is scaled.
        pull: How strongly the joints are led to a posture, in [1/s], and the posture. Shape (2, n).
        limits: See :func:`limits_with_braking`. Shape (5, n).
    """

    gain: float
    damping: float
    lm_damping: float
    braking_share: float
    scaling: bool
    pull: FloatArray
    limits: FloatArray


@kernel
def qp_step(model, numbers, seen, memory, answer):
    """One step of :class:`QuadraticProgram`; see :class:`CompiledPolicy` for the arguments."""
    jacobian, motion, error = task_motion(model.chain, model.kind, seen, memory)
    gain, damping, lm_damping, braking_share, scaling, pull, limits = numbers
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
class QuadraticProgram(TaskFeedback):
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
        damping: Weight of the joint motion as a share of that of the task. Above 0.
        lm_damping: How much that grows with the error. At least 0.
        secondary_gain: K in [1/s], at least 0 and below 2/Δt; 0 for the smallest joint velocity.
        posture: q* in [rad] or [m]; one number, or one a joint. If left out, the model's home; where it has none, the
            middle of the limits, and joints without limits are left alone.
        braking_share: Share of the acceleration limits that braking at the reference reckons with. At most 1; 0 takes
            back the same share of all errors.
        task_scaling: Whether to keep the direction of the task velocity.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    damping: float = parameter(3e-5, number, above=0.0)
    lm_damping: float = parameter(1e-5, number, at_least=0.0)
    secondary_gain: float = parameter(1.0, number, at_least=0.0)
    posture: float | Sequence[float] | None = None
    braking_share: float = parameter(0.5, number, at_least=0.0, at_most=1.0)
    task_scaling: bool = parameter(False, flag)
    _pull: FloatArray = dataclasses.field(init=False, repr=False)

    name: ClassVar[str] = "qp"
    step = qp_step

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_secondary_gain(self.secondary_gain)
        target, gains = self._posture()
        self._settle(_pull=read_only(np.array([gains, target])))

    def _posture(self) -> tuple[FloatArray, FloatArray]:
        """Target posture of the joints, and gain in [1/s]. Shapes (n,)."""
        model = self.problem.model
        everywhere = np.full(model.joints, self.secondary_gain)
        if self.posture is not None:
            posture = per_joint("posture", self.posture, model.joints)
            object.__setattr__(self, "posture", as_given(self.posture, posture))
            return posture, everywhere
        if model.home is not None:
            return model.home, everywhere
        limited, posture = middle(model)
        return posture, np.where(limited, everywhere, 0.0)

    @property
    def _brakes(self) -> bool:
        """Whether the feedback is made smaller far from the reference."""
        return self.braking_share > 0.0 and bool(np.isfinite(self.problem.model.acceleration_limit).any())

    def numbers(self) -> QuadraticProgramNumbers:
        """See :meth:`CompiledPolicy.numbers`."""
        share = self.braking_share if self._brakes else 0.0
        limits = limits_with_braking(self.problem)
        return QuadraticProgramNumbers(
            self.gain, self.damping, self.lm_damping, share, self.task_scaling, self._pull, limits
        )
