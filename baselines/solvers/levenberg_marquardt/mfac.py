"""Model-free adaptive control, which is the iteration of Levenberg and Marquardt (Zhang 2020, section III)."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Solution
from baselines.solvers.damped_step import damped_step, ran_away
from baselines.solvers.levenberg_marquardt.damped import DampedIteration
from baselines.solvers.levenberg_marquardt.damping_rules import condition_number, damping_next, damping_now
from baselines.solvers.linear_algebra import dot
from baselines.solvers.resolved_rate.moore_penrose import pseudoinverse_rows
from baselines.status import Status
from ikgym import task_kernels
from ikgym.jit import kernel
from ikgym.kinematics import forward_and_jacobian

_CONVERGED, _LIMIT = int(Status.CONVERGED), int(Status.ITERATION_LIMIT)
_DEFICIENT, _DIVERGED = int(Status.RANK_DEFICIENT), int(Status.DIVERGED)

#: Singular values below this share of the largest count as zero.
RANK_TOLERANCE = 1e-12


@dataclasses.dataclass(frozen=True, eq=False)
class ModelFreeAdaptiveControl(DampedIteration):
    """Goes to the next nominal point by damped least squares, again and again (eq. 11-17).

    At each period the model is iterated from the present joint coordinates:
    ``Δq_(i) = Jᵀ (J Jᵀ + λ_(i) I)⁻¹ e(y*(k+1), F(q_(i-1)))`` until ‖e‖ ≤ δ, the error being that of the task: for
    ``pose`` the rotation vector stands in for the printed arccos, which is 0/0 near 0. The printed (13) inverts
    JᵀJ + λ I; the form in the small space is the same and does not need n² numbers where J is flat.

    Statuses: ``converged`` where the model meets δ; ``iteration_limit`` where it does not, as for a point out of
    reach; ``rank_deficient`` where it does not and J had lost rank with a λ of 0, or too small to count, the
    directions lost being left out; ``diverged`` where the iterates are no numbers, or lead away from the point faster
    than the velocity limit: the arm is stopped for one step. The printed (14) takes back no bad step: out of reach,
    where λ falls while the Jacobian loses rank, it wanders, while ``sugihara`` comes to rest.

    For a ramp of velocity v per period one step with a constant J leaves the error U diag(λ/σ²) Uᵀ v (eq. 10).

    Args:
        problem: What the policy is told of the scenario.
        rule: The rule for λ; it and the ten numbers behind it are those of :class:`DampedIteration`.
        tolerance: δ, norm of the error at which the iteration stops, in the units of the task, [m] and [rad].
        iterations: N_up, most iterations of one period.
        one_step: Whether to apply the controller (5) once to the measured pose; δ and N_up do not matter then, and
            the status is ``converged`` where J has full rank.

    Raises:
        InvalidInputError: A number is out of its range, or does not belong to the rule.
        UnknownNameError: There is no such rule.
    """

    rule: str = "error_ratio"

    name: ClassVar[str] = "mfac"

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        problem = self.problem
        damping, error, factorised = self._start(memory)
        rows = len(batch.q)
        q, status, iterations = batch.q.copy(), np.empty(rows, dtype=np.int64), np.empty(rows, dtype=np.int64)
        iterate_rows(
            problem.model.chain,
            problem.task.kind,
            problem.task.error_size,
            self.rank,
            self.law,
            problem.dt * problem.velocity_limit,
            batch.q,
            batch.pose,
            batch.nominal,
            self.tolerance,
            self.iterations,
            self.one_step,
            q,
            damping,
            error,
            factorised,
            status,
            iterations,
        )
        return Solution((q - batch.q) / problem.dt, (damping, error, factorised), status, iterations)

    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """A Jacobian before each step and one for the last test; the controller (5) has one, and measures."""
        return 0, 1 if self.one_step else iterations + 1, iterations, int(self.one_step)


@kernel
def iterate_rows(
    chain,
    kind,
    size,
    rank,
    law,
    longest,
    start,
    pose,
    nominal,
    tolerance,
    most,
    one_step,
    q,
    damping,
    error_before,
    factorised,
    status,
    iterations,
):
    """The iteration (11)-(17) row by row.

    Args:
        chain: The model of the arm.
        kind: The kind of task coordinates.
        size: Components of the error, e.
        rank: The rank that J has where nothing is lost.
        law: The :class:`baselines.solvers.levenberg_marquardt.damping_rules.DampingLaw`.
        longest: Way of each joint in one period at the velocity limit. Shape (n,).
        start: q(k-1). Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        nominal: Nominal task coordinates ahead. Shape (B, at least 1, m).
        tolerance: δ.
        most: N_up.
        one_step: Whether to apply (5) once to the measured pose instead.
        q: Receives q(k); holds ``start`` before. Shape (B, n).
        damping: λ, goes on. Shape (B,).
        error_before: Norm of the error before, goes on. Shape (B,).
        factorised: Receives the matrices factorised. Shape (B,).
        status: Receives values of :class:`Status`. Shape (B,).
        iterations: Receives the iterations made. Shape (B,).
    """
    n, m = start.shape[1], pose.shape[1]
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    # With the leading axis that the pseudoinverse wants; without it, as views made once.
    jacobians, errors, steps = np.empty((1, size, n)), np.empty((1, size)), np.empty((1, n))
    jacobian, error, step = jacobians[0], errors[0], steps[0]
    coordinates, gram, x = np.empty(m), np.empty((size, size)), np.empty(size)
    columns, rotations = np.empty((max(n, size), min(n, size))), np.empty((min(n, size), min(n, size)))
    lost = np.empty(1, dtype=np.bool_)
    for row in range(start.shape[0]):
        here, target, measured = q[row], nominal[row, 0], pose[row]
        status[row], i, first = _LIMIT, 0, 0.0
        while True:
            forward_and_jacobian(chain, here, rotation, position, geometric)  # (11), (12)
            task_kernels.jacobian(kind, rotation, geometric, jacobian)
            task_kernels.coordinates(kind, rotation, position, coordinates)
            task_kernels.error(kind, target, measured if one_step else coordinates, error)
            norm = np.sqrt(dot(error, error))
            if i == 0:
                first = norm
            if not np.isfinite(norm):
                status[row] = _DIVERGED
                break
            if norm <= tolerance and not one_step:  # (16)
                status[row] = _CONVERGED
                break
            if i == most:
                break
            condition = 1.0
            if law.condition_bounds.shape[0] > 0:
                condition = condition_number(jacobian, rank, columns, rotations)
                factorised[row] += 1
            damping[row] = damping_now(law, norm, condition, damping[row])
            factorised[row] += 1
            if not damped_step(jacobian, error, damping[row], gram, x, step):  # (13)
                pseudoinverse_rows(jacobians, errors, RANK_TOLERANCE, rank, steps, lost)
                factorised[row] += 1
                if lost[0]:
                    status[row] = _DEFICIENT
            damping[row] = damping_next(law, damping[row], norm, error_before[row])  # (14), (18)
            error_before[row] = norm
            for k in range(n):
                here[k] += step[k]  # (15), (17)
            i += 1
            if one_step:
                if status[row] == _LIMIT:
                    status[row] = _CONVERGED
                break
        iterations[row] = i
        if not one_step and status[row] != _CONVERGED and norm > first and ran_away(here, start[row], longest):
            status[row] = _DIVERGED
        if status[row] == _DIVERGED:
            here[:] = start[row]
            damping[row], error_before[row] = law.damping, np.inf
