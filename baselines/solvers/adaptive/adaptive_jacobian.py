"""Resolved rate with a Jacobian whose parameters are adapted by the tracking error (Cheah, Liu and Slotine 2006)."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Solution, SolverPolicy, statuses
from baselines.solvers.adaptive.chain_parameters import changed_chain, parameter_twists
from baselines.solvers.adaptive.deviation import SIZE, add_deviation, missing_deviation
from baselines.solvers.adaptive.measurements import nothing_measured, recall
from baselines.solvers.resolved_rate.dls import damped_rows
from ikgym import task_kernels
from ikgym.exceptions import InvalidInputError
from ikgym.jit import kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.validation import FloatArray, IntArray, number, whole_number


class AdaptiveMemory(NamedTuple):
    """What is remembered from the step before.

    Attributes:
        before: See :class:`Measurement`. Shape (B, h, n).
        age: See :class:`Measurement`; below 0 where there was no step before. Shape (B, 1).
        nominal: X^N(k). Shape (B, m).
        pose: The last measured pose. Shape (B, m).
        then: The joint coordinates where it was measured, in [rad] or [m]. Shape (B, n).
        parameters: θ̂, see :mod:`baselines.solvers.adaptive.chain_parameters`. Shape (B, p).
    """

    before: FloatArray
    age: FloatArray
    nominal: FloatArray
    pose: FloatArray
    then: FloatArray
    parameters: FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class AdaptiveJacobian(SolverPolicy):
    """Adaptive Jacobian tracking (Cheah, Liu and Slotine 2006, IEEE Transactions on Automatic Control 51(6)).

    Taken over for an arm whose joint velocities are the input, without dynamics and actuators: the approximate Jacobian
    is linear in the kinematic parameters, Ĵ(q, θ̂) q̇ = Y(q, q̇) θ̂; the reference velocity in joint space is
    q̇ = Ĵ⁺ (ẋ_d − α Δx) with Δx = x − x_d; and the parameters follow the gradient of the task error,
    dθ̂/dt = L Yᵀ Δx. With V = ½ Δxᵀ Δx + ½ (θ − θ̂)ᵀ L⁻¹ (θ − θ̂) that gives dV/dt = −α Δxᵀ Δx: the error vanishes,
    and the parameters need not become right. This derivation is of this project, as is the sampled form

        q̇ Δt = Ĵᵀ (Ĵ Ĵᵀ + λ I)⁻¹ (X^N(k+1) − X^N(k) + g (X^N(k) − x)),  θ̂ ← θ̂ + L Y Δtᵀ (x − X^N(k)).

    Joint zeros and axes do not enter linearly; with Y Δt = ∂x/∂θ(q(k)) − ∂x/∂θ(q(k−1)) they do to the first order,
    links exactly. The paper measures the pose at each moment. Between measurements, and while they are late, the last
    one is moved along with the approximate model here.

    The law learns from the tracking error, and so from its noise: on an arm whose Jacobian is nearly right there is
    little to gain, unlike where links are wrong by a tenth.

    Args:
        problem: What the policy is told of the scenario.
        gain: g = α Δt, the share of the present error that is taken back in one step. Above 0 and below 2; much less
            where poses are noisy, or joints slow to accelerate.
        damping: λ, see :class:`DampedLeastSquares`. Above 0.
        adaptation: L, the same number for all parameters, of at least 0.
        history: See :class:`Corrected`.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    gain: float = 0.05
    damping: float = 1e-3
    adaptation: float = 1.0
    history: int = 64

    name: ClassVar[str] = "adaptive_jacobian"

    def __post_init__(self) -> None:
        for name in ("gain", "damping"):
            object.__setattr__(self, name, number(name, getattr(self, name), above=0.0))
        if self.gain >= 2.0:
            raise InvalidInputError(f"gain: expected a number above 0 and below 2, got {self.gain:g}.")
        object.__setattr__(self, "adaptation", number("adaptation", self.adaptation, at_least=0.0))
        object.__setattr__(self, "history", whole_number("history", self.history, at_least=1))

    def memory(self, rows: int) -> AdaptiveMemory:
        """An :class:`AdaptiveMemory` without a step before, of the model as it is."""
        n, m = self.problem.model.joints, self.problem.task.size
        sensors, pose = nothing_measured(rows, self.history, n), np.zeros((rows, m))
        return AdaptiveMemory(*sensors, pose, pose.copy(), np.zeros((rows, n)), np.zeros((rows, 6 * n + 3)))

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        own, problem = AdaptiveMemory(*memory), self.problem
        rows, n, e = len(batch.q), problem.model.joints, problem.task.error_size
        measured = recall(batch, problem.dt, own.before, own.age)
        new, target = measured.new[:, None], batch.nominal[:, 0].copy()
        pose, then = np.where(new, batch.pose, own.pose), np.where(new, measured.q, own.then)
        present = np.where(own.age >= 0.0, own.nominal, pose)
        jacobian, shift, qdot = np.empty((rows, e, n)), np.empty((rows, e)), np.empty((rows, n))
        parameters, rule = own.parameters.copy(), (problem.model.chain, problem.task.kind, self.gain, self.adaptation)
        last = measured.before[:, min(1, self.history - 1)]
        adapt_rows(rule, (batch.q, last, then), (pose, present, target), parameters, jacobian, shift)
        damped_rows(jacobian, shift, self.damping, qdot)
        kept = AdaptiveMemory(measured.before, measured.age, target, pose, then, parameters)
        return Solution(qdot / problem.dt, kept, statuses(rows), np.ones(rows, np.int64))

    def count(self, iterations: IntArray) -> tuple[npt.ArrayLike, ...]:
        """Jacobians here, a step ago, and where the pose was measured."""
        return 0, 3, 1, 1


@kernel
def adapt_rows(rule, postures, poses, parameters, jacobian, shift):
    """Parameters, Jacobians and the task shifts asked for, row by row.

    Args:
        rule: The model of the arm, the kind of task coordinates, the gain and the rate of adaptation.
        postures: Joint coordinates at present, a step ago, and where the pose was measured, in [rad] or [m]. Shapes
            (B, n).
        poses: The last measured task coordinates, X^N(k) and X^N(k+1). Shapes (B, m).
        parameters: Changed in place. Shape (B, p).
        jacobian: Receives Ĵ. Shape (B, e, n).
        shift: Receives the task shifts. Shape (B, e).
    """
    (chain, kind, gain, rate), (q, last, then), (pose, present, target) = rule, postures, poses
    rows, e, n, p = q.shape[0], jacobian.shape[1], q.shape[1], parameters.shape[1]
    offsets, axes, tool = np.empty((n, 3)), np.empty((n, 3)), np.empty(3)
    regressor, before, error, deviation = np.empty((e, p)), np.empty((e, p)), np.empty(e), np.empty(SIZE)
    here, there, moved = np.empty(pose.shape[1]), np.empty(pose.shape[1]), np.empty((1, pose.shape[1]))
    none = np.zeros(SIZE)
    unused = np.empty((e, n))
    for row in range(rows):
        zeros = parameters[row, :n]
        arm = changed_chain(chain, parameters[row], offsets, axes, tool)
        _at(arm, kind, then[row] + zeros, there, unused, before)
        _at(arm, kind, last[row] + zeros, here, unused, before)
        _at(arm, kind, q[row] + zeros, here, jacobian[row], regressor)
        # The measured pose, moved along with the approximate model.
        missing_deviation(kind, pose[row], there, none, deviation)
        add_deviation(kind, deviation, 1.0, here.reshape(moved.shape), moved)
        task_kernels.error(kind, present[row], moved[0], error)
        task_kernels.error(kind, target[row], present[row], shift[row])
        for i in range(e):
            shift[row, i] += gain * error[i]
            for j in range(p):
                parameters[row, j] -= rate * (regressor[i, j] - before[i, j]) * error[i]


@kernel
def _at(arm, kind, q, coordinates, jacobian, regressor):
    """Task coordinates, and their derivatives by joint coordinates and by the parameters: (m,), (e, n), (e, p)."""
    n, p = q.shape[0], regressor.shape[1]
    rotation, position, geometric, twist = np.empty((3, 3)), np.empty(3), np.empty((6, n)), np.zeros((6, p))
    forward_and_jacobian(arm, q, rotation, position, geometric)
    task_kernels.coordinates(kind, rotation, position, coordinates)
    task_kernels.jacobian(kind, rotation, geometric, jacobian)
    parameter_twists(arm, q, position, twist)
    task_kernels.jacobian(kind, rotation, twist, regressor)
