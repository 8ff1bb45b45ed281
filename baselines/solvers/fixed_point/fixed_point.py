"""Matrix-inversion-free inverse kinematics by fixed-point transformation (Faitli and Tar 2018; Khan and Tar 2020)."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Solution, SolverPolicy
from baselines.solvers.arm_task import arm_task_of, plain_arm_task, pose_arrays
from baselines.solvers.fixed_point.contraction import Contraction, contraction, evaluate
from baselines.solvers.linear_algebra import dot
from baselines.status import Status
from ikgym import task_kernels
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.jit import kernel
from ikgym.kinematics import Chain, forward, forward_and_jacobian
from ikgym.validation import FloatArray, known_name, number, whole_number

#: What is done to f(q) - x before it is added to q, with the numbers that the kernel knows.
TRANSFORMATIONS = {"transpose": 0, "none": 1, "sign": 2}
_TRANSPOSE, _SIGN = TRANSFORMATIONS["transpose"], TRANSFORMATIONS["sign"]
_CONVERGED, _LIMIT, _DIVERGED = int(Status.CONVERGED), int(Status.ITERATION_LIMIT), int(Status.DIVERGED)
# ‖∂x/∂q‖² of the orientation's numbers for a joint that turns at 1 rad/s, at most.
_TURNING = {
    task_kernels.POSITION: 0.0,
    task_kernels.SKEW: 1.0,
    task_kernels.MATRIX: 2.0,
    task_kernels.POSE: 1.0,
    task_kernels.AXIS: 1.0,
}


class DirectionMemory(NamedTuple):
    """What the transformation ``"sign"`` remembers of the last iteration of the step before.

    Attributes:
        direction: σ (f - x), zero where there was none. Shape (B, n).
    """

    direction: FloatArray


class FixedPointRule(NamedTuple):
    """What the parameters of the policy say to the kernel.

    Attributes:
        transformation: One of the numbers in TRANSFORMATIONS.
        function: F.
        a: A.
        iterations: How many are made.
        tolerance: ‖f - x‖ up to which they have converged.
        longest: How far the joints can go in one step, in [rad] or [m]. Shape (n,).
    """

    transformation: int
    function: Contraction
    a: float
    iterations: int
    tolerance: float
    longest: FloatArray


class Extension(NamedTuple):
    """What x is extended by: a point of the arm, and where it should be.

    Attributes:
        chain: The chain to the point.
        points: Where it should be, in [m]; of no columns if x is not extended. Shape (B, 3 or 0).
    """

    chain: Chain
    points: FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class FixedPoint(SolverPolicy):
    """Iterates q ← q + [F(A ‖h‖ + ξ*) - ξ*] h/‖h‖ with h = Jᵀ (f(q) - x), whose fixed point solves the task (eq. 1).

    F is any function with an attractive fixed point ξ*, see :func:`contraction.contraction`. In the affine
    family D cancels, and the paper's F(ξ) = ξ/2 + D makes the step q + (A/2) Jᵀ (f(q) - x): the transposed Jacobian.
    In the sigmoid family D does not cancel, and the length of a step is bounded. Around a solution the error of q is
    multiplied by I + F'(ξ*) A JᵀJ (Khan 2020, eq. 2.6): it contracts for -2/σ_max² < F'(ξ*) A < 0, that is for
    |A| < 4/σ_max² in the paper, in all directions in which J has rank. In the others nothing moves, which is the
    method's good behaviour at singularities, and why it leaves a path there that goes on along them.

    The iterations of a step use the model alone: a pose is never measured, so that a wrong model's error stays.
    Where f - x is a rotation error (task ``pose``) it stands for f(q) - x.

    Args:
        problem: What the policy is told of the scenario.
        transformation: ``"transpose"``: h = Jᵀ (f(q) - x), as above. ``"none"``: h = f(q) - x, Dineva's own form
            (Khan 2020, eq. 2.5), which converges where all eigenvalues of F'(ξ*) A J have negative real parts, as
            those of few arms do. ``"sign"``: h = σ (f(q) - x), σ = ±1 (Khan 2020, eq. 2.8; he had no success with it
            beyond 2 joints). The paper says only that σ depends on the direction of the previous step; it is read as
            the one-dimensional case of his 𝒩: σ = -1 where f - x points away from the one before. The last two
            use no Jacobian, and need as many components of the error as joints.
        family: The family of F, ``"affine"`` or ``"sigmoid"``.
        slope: The factor in F; ½ in the paper.
        a: A, negative with a rising F and ``"transpose"``. If left out, the paper's -1 where 2/σ_max² allows it, and
            -2/(|F'(ξ*)| ‖J‖²) where it may not, from a bound of ‖J‖² by the lengths of the links, with prismatic
            joints at home.
        d: D.
        iterations: Iterations in one step; all of them are made.
        tolerance: ‖f(q) - x‖ after the last up to which the status is ``converged``, in [m] and [rad] or [1].

    Raises:
        InvalidInputError: A parameter is out of its range, or the transformation does not suit the task.
        UnknownNameError: There is no such transformation or family.
    """

    transformation: str = "transpose"
    family: str = "affine"
    slope: float = 0.5
    a: float | None = None
    d: float = 0.3
    iterations: int = 10
    tolerance: float = 1e-6
    #: F.
    function: Contraction = dataclasses.field(init=False, repr=False)

    name: ClassVar[str] = "fixed_point"

    def __post_init__(self) -> None:
        known_name("transformation", self.transformation, TRANSFORMATIONS)
        size, joints = self.problem.task.error_size, self.problem.model.joints
        if self.transformation != "transpose" and size != joints:
            raise InvalidInputError(
                f"transformation {self.transformation!r} needs as many components of the error as joints; task "
                f"{self.problem.task.name!r} has {size}, arm {self.problem.model.name!r} {joints} joints."
            )
        object.__setattr__(self, "function", contraction(self.family, self.slope, self.d))
        object.__setattr__(self, "a", self._contracting() if self.a is None else number("a", self.a))
        if self.a == 0.0:
            raise InvalidInputError("a: expected a number other than 0, got 0: nothing would move.")
        whole_number("iterations", self.iterations, at_least=1)
        number("tolerance", self.tolerance, at_least=0.0)

    def memory(self, rows: int) -> Memory:
        """A :class:`DirectionMemory` without a step before, where the sign depends on it; else nothing."""
        zeros = np.zeros((rows, self.problem.model.joints))
        return DirectionMemory(zeros) if self.transformation == "sign" else ()

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        problem = self.problem
        rows = len(batch.q)
        q, status = batch.q.copy(), np.empty(rows, dtype=np.int64)
        previous = DirectionMemory(*memory).direction.copy() if memory else np.empty((rows, 0))
        branch, points = self._extension(batch)
        iterate_rows(
            plain_arm_task(problem),
            (tuple(branch), points),
            self._method,
            np.ascontiguousarray(batch.nominal[:, 0]),
            previous,
            q,
            status,
        )
        kept = DirectionMemory(previous) if memory else ()
        return Solution((q - batch.q) / problem.dt, kept, status, np.full(rows, self.iterations))

    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """A Jacobian an iteration, or forward kinematics where none is used, and the last error for the status."""
        if self.transformation == "transpose":
            return 1, iterations, 0, 0
        return iterations + 1, 0, 0, 0

    @functools.cached_property
    def _method(self) -> tuple[Any, ...]:
        """A plain :class:`FixedPointRule`."""
        transformation, longest = TRANSFORMATIONS[self.transformation], self.problem.velocity_limit * self.problem.dt
        return transformation, tuple(self.function), self.a, self.iterations, self.tolerance, longest

    def _extension(self, batch: Batch) -> tuple[Chain, FloatArray]:
        """What x is extended by: the chain to another point of the arm, and its nominal position; here nothing."""
        return self.problem.model.chain, np.empty((len(batch.q), 0))

    def _jacobian_bound(self) -> float:
        """A number that ‖J‖² does not exceed, with prismatic joints at home."""
        return jacobian_bound(self.problem.model, _TURNING[self.problem.task.kind])

    def _contracting(self) -> float:
        """The paper's A, or as much of it as is sure to contract with the transposed Jacobian."""
        size = min(1.0, 2.0 / (abs(self.function.derivative) * self._jacobian_bound()))
        return -math.copysign(size, self.function.derivative)


def jacobian_bound(arm: Arm, turning: float) -> float:
    """The sum over the joints of the largest ‖∂x/∂q_j‖², by the lengths of the links.

    Args:
        arm: The arm; its prismatic joints are taken to be at home.
        turning: What the orientation's numbers add for a joint that turns.
    """
    links = np.append(np.linalg.norm(arm.offsets[1:], axis=1), np.linalg.norm(arm.tool))
    reach = np.cumsum(links[::-1])[::-1]
    return float(np.where(arm.prismatic, 1.0, reach**2 + turning).sum())


@kernel
def iterate_rows(arm_task, extension, method, target, previous, q, status):
    """The iterations of one step, row by row.

    Args:
        arm_task: The model of the arm and the task, a plain :class:`ArmTask`.
        extension: A plain :class:`Extension`.
        method: A plain :class:`FixedPointRule`.
        target: x. Shape (B, m).
        previous: With the sign variant, the last f - x; overwritten. Shape (B, n).
        q: Joint coordinates, changed in place. Shape (B, n).
        status: Receives values of :class:`Status`. Shape (B,).
    """
    (chain, kind), chain_to_point, points = arm_task_of(arm_task), Chain(*extension[0]), extension[1]
    transformation, numbers, a, iterations, tolerance, longest = method
    function = Contraction(*numbers)
    n, m, joints = q.shape[1], target.shape[1], chain_to_point.axes.shape[0]
    e = task_kernels.error_size(kind, m)
    rotation, position, geometric, pose = pose_arrays(n, m)
    error, jacobian, partial = np.empty(e), np.empty((e, n)), np.empty((6, joints))
    h, start, missing = np.empty(n), np.empty(n), np.empty(3)
    for row in range(q.shape[0]):
        here = q[row]
        start[:] = here
        first = residual = 0.0
        for step in range(iterations + 1):
            last = step == iterations
            if last or transformation != _TRANSPOSE:
                forward(chain, here, rotation, position)
            else:
                forward_and_jacobian(chain, here, rotation, position, geometric)
                task_kernels.jacobian(kind, rotation, geometric, jacobian)
            task_kernels.coordinates(kind, rotation, position, pose)
            task_kernels.error(kind, target[row], pose, error)
            square = dot(error, error)
            h[:] = 0.0
            if transformation == _TRANSPOSE:
                _add_transposed(jacobian, error, h)
            else:
                for j in range(n):
                    h[j] = -error[j]
            if points.shape[1] > 0:
                if last:
                    forward(chain_to_point, here[:joints], rotation, position)
                else:
                    forward_and_jacobian(chain_to_point, here[:joints], rotation, position, partial)
                for i in range(3):
                    missing[i] = points[row, i] - position[i]
                square += dot(missing, missing)
                _add_transposed(partial[:3], missing, h)
            residual = math.sqrt(square)
            if step == 0:
                first = residual
            if last:
                break
            if transformation == _SIGN:
                _keep_direction(h, previous[row])
            _contract(function, a, h, here)
        status[row] = _CONVERGED if residual <= tolerance else _LIMIT
        # Further off than at the start, and further away than the drives can go.
        if not residual <= first:
            for j in range(n):
                if not abs(here[j] - start[j]) <= longest[j]:
                    status[row] = _DIVERGED
        if status[row] == _DIVERGED:
            here[:] = start
            if transformation == _SIGN:
                previous[row] = 0.0


@kernel
def _contract(function, a, h, q):
    """Eq. 1; where h = 0 its limit, which is to stay."""
    norm = math.sqrt(dot(h, h))
    if norm == 0.0:
        return
    amount = evaluate(function, a * norm + function.fixed_point) - function.fixed_point
    for j in range(q.shape[0]):
        q[j] += amount * (h[j] / norm)


@kernel
def _add_transposed(jacobian, missing, h):
    """Adds Jᵀ (f - x) to h, with ``missing`` = x - f of shape (e,); the joints past J's columns have no part."""
    for i in range(jacobian.shape[0]):
        for j in range(jacobian.shape[1]):
            h[j] -= jacobian[i, j] * missing[i]


@kernel
def _keep_direction(h, previous):
    """Khan 2020, eq. 2.8: turns h about where it points away from the one before, which it then replaces."""
    sign = -1.0 if dot(h, previous) < 0.0 else 1.0
    for j in range(h.shape[0]):
        previous[j] = h[j]
        h[j] *= sign
