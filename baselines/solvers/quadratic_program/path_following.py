"""Path following: the quadratic program with the progress along the reference as one more variable."""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated, ClassVar

import numpy as np

from baselines.policy import Memory
from baselines.policy.compiled import derived
from baselines.solvers.quadratic_program.base import VelocityProgram
from baselines.solvers.quadratic_program.box_minimum import box_minimum
from baselines.solvers.quadratic_program.path_memory import (
    PathMemory,
    interpolate_motion,
    moves_around,
    remember,
    slope,
)
from baselines.solvers.quadratic_program.path_speed import SEGMENTS, joint_path_ahead, path_speed
from baselines.solvers.quadratic_program.program import (
    SCALING_WEIGHT,
    curvature,
    factorise,
    feedback_share,
    goal_along_path,
    held_back,
    motion_weight,
    weigh_rotation,
)
from baselines.solvers.quadratic_program.velocity_box import calm_gain, smooth_box
from baselines.solvers.resolved_rate.base import APPLIED
from baselines.status import Status
from ikgym.kernels import tasks
from ikgym.kernels.jit import inlined, inner, kernel
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.kernels.limits import CHANGE, FASTEST
from ikgym.kernels.linear_algebra import dot
from ikgym.validation import Bounds, FloatArray, read_only

LIMIT, SATURATED = int(Status.ITERATION_LIMIT), int(Status.SATURATED)
# Samples that the spline needs ahead.
FEWEST = 4
# The second solve aims at the speed that the first one reached, and takes back the error accepted for it.
SOLVES = 2
# The target for the speed of the reference, above it because of the damping, and the speed that counts as none.
AMPLE, STUCK = 1.05, 1e-6
# The speed that no limit of the path ahead goes below, the error in [m] or [rad] from which on the reference slows down
# for the arm, and a short part of a step.
CRAWL, AWAY, SHORT = 1e-3, 0.01, 0.1


@kernel
def path_step(model, numbers, batch, solution):
    """One step of :class:`PathFollowing`; see :class:`CompiledPolicy` for the arguments."""
    memory = solution.memory
    (q, last), dt, limits, pull = (batch.q, batch.qdot), model.dt, model.limits, numbers.pull
    n, e = q.shape[1], tasks.error_size(model.kind, batch.pose.shape[1])
    hessian, linear, x = np.empty((n + 1, n + 1)), np.empty(n + 1), np.empty(n + 1)
    lower, upper, preferred, jac = np.empty(n + 1), np.empty(n + 1), np.empty(n), np.empty((e, n))
    motion, missing, shift, factor, weights = np.empty(e), np.empty(e), np.empty(e), np.empty((n, n)), numbers.weights
    for row in range(q.shape[0]):
        samples, steps, progress = memory.samples[row], memory.steps[row], memory.progress[row]
        remember(samples, steps, batch.nominal[row])
        speed = _path_ahead(
            model, numbers, samples, progress, memory.speed[row], batch.pose[row], q[row], jac, motion, missing
        )
        smooth_box(limits, dt, q[row], last[row], batch.change[row], lower, upper)
        for j in range(n):
            preferred[j] = pull[0, j] * (pull[1, j] - q[row, j])
        weigh_rotation(model.kind, numbers.rotation_weight, jac, motion, missing)
        jac *= dt
        missing *= calm_gain(limits, numbers.gain)
        weight = motion_weight(jac, missing, numbers.damping, numbers.lm_damping, weights, limits[FASTEST])
        weight *= SCALING_WEIGHT
        curvature(jac, weight, weights, hessian)
        if numbers.braking > 0.0 and factorise(hessian, factor):
            missing *= feedback_share(factor, jac, missing, calm_gain(limits, 1.0) * numbers.braking, limits[CHANGE])
        least = min(max(steps + 1.0 - numbers.latest - progress, 0.0), 1.0)
        goals = weight, weights, preferred, speed, least
        made, solution.iterations[row], found = _minimum(
            jac, motion, missing, goals, (hessian, linear, lower, upper), x
        )
        memory.steps[row], memory.progress[row], memory.speed[row] = steps + 1, progress + made, made
        for j in range(n):
            solution.qdot[row, j] = x[j]
        for a in range(e):
            shift[a] = missing[a] + made * motion[a]
        held = held_back(jac, shift, weight, weights, preferred, solution.qdot[row], lower, upper, False)
        stuck = made <= max(least, STUCK) < speed
        solution.status[row] = SATURATED if held or stuck else APPLIED if found else LIMIT


@inner
def _minimum(jacobian, motion, error, goals, program, x):
    """Joint velocities, then s ‖Δx‖, into x (n + 1,); the program's bounds of the joints are set, the rest is not.

    ``goals`` are the weight of the joint motion, those of the joints, preferred joint velocities, the speed to aim at,
    and the least one. Returns the progress in steps of the reference, the number of solves, and whether the optimum was
    found.
    """
    (weight, weights, preferred, speed, least), (hessian, linear, lower, upper), n = goals, program, x.shape[0] - 1
    aim, made, iterations, found = speed, least, 0, False
    for _ in range(SOLVES):
        length = goal_along_path(jacobian, motion, error, weight, weights, preferred, aim, hessian, linear)
        lower[n], upper[n] = least * length, length
        solves, found = box_minimum(hessian, linear, lower, upper, x)
        iterations += solves
        made = min(max(x[n] / length if length > 0.0 else speed, least), 1.0)
        if made > 0.999 * min(speed, 1.0):
            break
        aim = made
    return made, iterations, found


@inlined
def _readiness(error):
    """Share of the speed that an arm off the path is left: none from twice AWAY on."""
    return min(max(2.0 - error / AWAY, 0.0), 1.0)


@inner
def _path_ahead(model, numbers, samples, progress, last, pose, q, jacobian, motion, missing):
    """Where the path is, and where it leads: the speed to aim at; above 1 where nothing is in the way.

    Receive: ``jacobian`` J (e, n), ``motion`` (e,) that of the reference at full speed in one step, ``missing`` (e,)
    the error against the reference at this progress.
    """
    first, (e, n) = int(progress), jacobian.shape
    part = progress - first
    moves, passed, tangents = np.empty((4, e)), np.empty(e), np.empty((numbers.segments, n))
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    moves_around(model.kind, samples, first, moves)
    interpolate_motion(moves, part, passed)
    tasks.error(model.kind, samples[first % samples.shape[0]], pose, missing)
    missing += passed
    slope(moves, part, SHORT, motion)
    joint_path_ahead(model, numbers, samples, first, passed, motion, q, tangents)
    speed = path_speed(tangents, numbers.stride, part, last, numbers.fastest, numbers.change)
    slope(moves, part, max(speed, SHORT), motion)  # that of this step
    speed = (max(speed, CRAWL) if speed < 1.0 else AMPLE) * _readiness(math.sqrt(dot(missing, missing)))
    forward_and_jacobian(model.chain, q, rotation, position, geometric)
    tasks.jacobian(model.kind, rotation, geometric, jacobian)
    return speed


@dataclasses.dataclass(frozen=True, eq=False)
class PathFollowing(VelocityProgram):
    """`qp` with free timing: where limits bind, the arm follows the path more slowly instead of leaving it.

    The progress s in one step, from 0 to 1 steps of the reference, is one more variable of the quadratic program:
    ‖J q̇ Δt − s Δx − e‖² + w (s* − s)² ‖Δx‖² + w ρ ‖q̇ − z‖²_W is minimised over q̇ and s, with w = 0.01, the motion Δx
    of the reference, and the error e against the reference at the progress of the arm. Path comes before speed, and
    speed before joint motion. Lost time is not made up for: no path is followed faster than it is shown.

    s* is the largest speed from which the arm can come to rest where the view ends, within the limits of velocity and
    acceleration (:func:`path_speed`), along the joint path of the smallest joint motions. Samples of the reference are
    remembered until they are passed, and are joined by a cubic spline. More than 1 cm or
    0.01 rad off the path the progress is slower, and from twice that on the reference waits for the arm.

    The status is ``saturated`` where a joint is at a bound and the error that is left weighs more than the motion,
    and where the arm is as late as it may be, and is led on at full speed.

    Args:
        problem: The scenario as the policy knows it, with the limits of the model.
        gain, damping, lm_damping, secondary_gain, posture, braking_share, rotation_weight, joint_weights: See
            :class:`VelocityProgram`.
        lookahead: How far ahead the reference is seen, in [s]: as long as the arm needs for braking.
        longest_lateness: How far the arm may fall behind the reference, in [s].
        acceleration_share: Share of the acceleration limits assumed for the speed along the path. Above 0, at
            most 1.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    lookahead: Annotated[float, Bounds(above=0.0, at_most=60.0)] = 0.2
    longest_lateness: Annotated[float, Bounds(above=0.0, at_most=3600.0)] = 2.0
    acceleration_share: Annotated[float, Bounds(above=0.0, at_most=1.0)] = 0.9
    #: Steps of the reference in a segment of the path ahead.
    stride: int = derived()
    #: Number of segments.
    segments: int = derived()
    #: Most steps behind the reference.
    latest: int = derived()
    #: Largest joint motion in one step that the path ahead is planned with, in [rad] or [m]. Shape (n,).
    fastest: FloatArray = derived()
    #: Its largest change from step to step. Shape (n,).
    change: FloatArray = derived()

    name: ClassVar[str] = "qp_path"
    step = path_step

    def __post_init__(self) -> None:
        super().__post_init__()
        dt, stride = self.problem.dt, max(2, math.ceil(self.preview / SEGMENTS))
        acceleration = self.problem.model.acceleration_limit
        change, limited = acceleration.copy(), np.isfinite(acceleration)
        change[limited] *= self.acceleration_share * dt * dt
        self._settle(
            stride=stride,
            segments=self.preview // stride,
            latest=math.ceil(self.longest_lateness / dt),
            fastest=read_only(dt * self.problem.largest_qdot),
            change=read_only(change),
        )

    @property
    def soft(self) -> bool:
        """See :attr:`VelocityProgram.soft`: no, since the arm would crawl on where the path leaves its reach."""
        return False

    @property
    def free_timing(self) -> bool:
        """See :attr:`SolverPolicy.free_timing`."""
        return True

    @property
    def preview(self) -> int:
        """The steps of ``lookahead``, four at least."""
        return max(FEWEST, math.ceil(self.lookahead / self.problem.dt))

    def memory(self, rows: int) -> PathMemory:
        """See :meth:`SolverPolicy.memory`."""
        kept = self.latest + self.preview + 2
        samples = np.zeros((rows, kept, self.problem.task.size))
        return PathMemory(samples, np.zeros(rows, dtype=np.int64), np.zeros(rows), np.zeros(rows))

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """``progress`` along the reference, in steps of it."""
        return {"progress": PathMemory(*self.memory_of(state)).progress.copy()}
