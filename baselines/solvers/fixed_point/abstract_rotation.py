"""Adaptive inverse kinematics by abstract rotations, without inversion (Khan and Tar 2020)."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np

from baselines.policy import Memory, Problem
from baselines.policy.compiled import CompiledPolicy, derived
from baselines.solvers.arm_size import jacobian_bound
from baselines.solvers.fixed_point.rotations import adaptive_deform, plane, turn
from baselines.status import Status
from ikgym import arms, tasks
from ikgym.exceptions import InvalidInputError
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.kernels.linear_algebra import dot, transposed_product
from ikgym.validation import Bounds, FloatArray, as_given, one_of, per_joint

#: Vectors that 𝒩 rotates, with their numbers in the kernel.
COUNTER_ROTATIONS = {"none": 0, "joints": 1, "task": 2}
#: Deformations of the joint coordinates, with their numbers in the kernel.
DEFORMATIONS = {"rotation": 0, "contraction": 1}
#: The listing's addition to a norm before division, and its bound of joint coordinates, a tanh, in [rad] or [m];
#: neither is printed.
EPSA, Q_PP_MAX = 1e-12, 1e3
#: The paper's λ_a, and its conditions.
PAPERS_SHARE, PAPERS_MODEL, PAPERS_TASK = 5e-4, "khan8_approximate", "matrix"
_JOINTS, _TASK, _CONTRACTION = COUNTER_ROTATIONS["joints"], COUNTER_ROTATIONS["task"], DEFORMATIONS["contraction"]
_CONVERGED, _LIMIT, _NO_ROTATION = int(Status.CONVERGED), int(Status.ITERATION_LIMIT), int(Status.NOT_A_ROTATION)


class RotationMemory(NamedTuple):
    """Memory of the previous step.

    Attributes:
        direction: h(n-1), or ℱ (xᴺ - f) where 𝒩 turns task coordinates; zero at the start. Shape (B, n or m).
        angles: The angle of 𝒩, between 0 and π, and λ_a φ in [rad]; NaN where there was none. Shape (B, 2).
        point: The nominal point since which the Jacobian is held, NaN at the start; of no columns where it is not
            held. Shape (B, m or 0).
        held: The joint coordinates that it belongs to. Shape (B, n or 0).
    """

    direction: FloatArray
    angles: FloatArray
    point: FloatArray
    held: FloatArray


@kernel
def rotation_step(model, numbers, batch, solution):
    """One inner iteration, row by row; see :class:`CompiledPolicy` for the arguments."""
    chain, kind, dt = model.chain, model.kind, model.dt
    counter_rotation, deformation = numbers.codes
    rule = numbers.r_a, numbers.share, EPSA, Q_PP_MAX
    q, pose, nominal, (direction, angles, point, held) = batch.q, batch.pose, batch.nominal, solution.memory
    goals, _, status, iterations = solution
    n, m, turned = q.shape[1], pose.shape[1], direction.shape[1]
    rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
    jacobian, error, extended = np.empty((m, n)), np.empty(m), np.empty((3, n + 1))
    h, actual, desired, e_a, e_b = np.empty(n), np.empty(n), np.empty(n), np.empty(turned), np.empty(turned)
    missing, weighted, wanted = np.empty(m), np.empty(m), np.empty(m)
    for row in range(q.shape[0]):
        target, goal = nominal[row, 0], goals[row]
        forward_and_jacobian(chain, _configuration(q[row], target, point, held, row), rotation, position, geometric)
        # The method knows no other error than a difference of coordinates.
        task_kernels.coordinate_jacobian(kind, rotation, geometric, jacobian)
        for i in range(m):
            error[i] = target[i] - pose[row, i]
            missing[i] = numbers.f[i] * error[i]
            weighted[i] = numbers.f[i] * pose[row, i]
            wanted[i] = numbers.f[i] * target[i]
        angles[row, 0] = 0.0
        if counter_rotation == _TASK:
            angles[row, 0] = _turn_back(missing, direction[row], e_a, e_b, weighted, wanted)
        transposed_product(jacobian, missing, h)
        transposed_product(jacobian, weighted, actual)
        transposed_product(jacobian, wanted, desired)
        if counter_rotation == _JOINTS:
            angles[row, 0] = _turn_back(h, direction[row], e_a, e_b, actual, desired)
        for i in range(turned):
            direction[row, i] = missing[i] if counter_rotation == _TASK else h[i]
        for j in range(n):
            actual[j] *= numbers.w[j]
            desired[j] *= numbers.w[j]
        for j in range(n):
            goal[j] = q[row, j]
        status[row] = _CONVERGED if math.sqrt(dot(error, error)) <= numbers.tolerance else _LIMIT
        if deformation == _CONTRACTION:
            angles[row, 1] = math.nan
            for j in range(n):
                goal[j] += numbers.share * (desired[j] - actual[j])
        else:
            angles[row, 1] = adaptive_deform(actual, q[row], desired, rule, extended, goal)
            if math.isnan(angles[row, 1]):
                status[row] = _NO_ROTATION
        iterations[row] = 1
        for j in range(n):
            goal[j] = (goal[j] - q[row, j]) / dt


@inner
def _configuration(q, target, point, held, row):
    """Point of the Jacobian: q, or the posture at which the target last changed."""
    if held.shape[1] == 0:
        return q
    for i in range(target.shape[0]):
        if target[i] != point[row, i]:
            for k in range(target.shape[0]):
                point[row, k] = target[k]
            for k in range(q.shape[0]):
                held[row, k] = q[k]
            break
    return held[row]


@inner
def _turn_back(now, last, e_a, e_b, actual, desired):
    """Applies the 𝒩 that turns a vector into its last direction, and returns the angle."""
    angle = plane(now, last, e_a, e_b)
    turn(e_a, e_b, angle, actual)
    turn(e_a, e_b, angle, desired)
    return angle


@dataclasses.dataclass(frozen=True, eq=False)
class AbstractRotation(CompiledPolicy):
    """Turns q by a share of the rotation that leads from the measured to the wanted vector (eq. 3.16, section 4.1).

    One call is one inner iteration, and the arm moves: with the Jacobian J̃ = ∂f/∂q of the model at q and the measured
    coordinates f, the next joint coordinates are

        q(n+1) = AdaptiveDeform(𝒲 𝒩 J̃ᵀ ℱ f, q(n), 𝒲 𝒩 J̃ᵀ ℱ xᴺ),

    that is q(n), extended by a ninth number to the length R_a, turned by λ_a times the angle between the other two,
    in their plane. Where all three are short compared with R_a this is q + λ_a 𝒲 𝒩 J̃ᵀ ℱ (xᴺ - f): a transposed-Jacobian
    step, which contracts for λ_a σ_max² < 2 if the model is close. A vector b that is not short, |b| = R_a sin β,
    makes the step 1/cos β times longer along b, and cos β times shorter across. At rest J̃ᵀ ℱ (xᴺ - f) = 0, up to
    the listing's limiting by tanh, which shrinks q by about q³ / (3 q_pp_max²) in every step: the joints move slowly
    towards 0 in the directions that the task leaves free.

    The counter-rotation 𝒩 turns h(n) = J̃ᵀ ℱ (xᴺ - f) into the direction of h(n-1), as it was before its
    rotation; otherwise no direction could ever change. It is n × n, without which eq. 3.16 does not fit together
    (the conclusion says 12 dimensions). h is remembered from point to point, and is not known at the first step,
    where 𝒩 = I. Between opposite vectors the plane is not determined, see :func:`rotations.plane`. Read with the
    conclusion's 12 dimensions, 𝒩 turns ℱ (xᴺ - f) before J̃ᵀ is applied: 𝒲 J̃ᵀ 𝒩 ℱ f, and likewise for xᴺ.

    The method that the paper starts from (eq. 2.9) is Dineva's iteration (eq. 2.5) with the same 𝒩 and the measured
    f: q(n+1) = q + [F(A ‖h‖ + ξ*) - ξ*] h/‖h‖ with h = 𝒩 J̃ᵀ (f - xᴺ). Of an affine F only the product of A and its
    slope acts, which is -λ_a here: q + λ_a 𝒲 𝒩 J̃ᵀ ℱ (xᴺ - f).

    λ_a σ² goes with the square of the arm's length, and λ_a, where it is left out, against it. With one iteration a
    step the method is slow along the directions of small σ, in which an error takes 1 / (λ_a σ²) steps: some 25,000 on
    the paper's arm, where σ² reaches from 0.08 to 340. Fails where the model's Jacobian points away from the arm's:
    then the error stays or grows, and the status never says ``converged`` of that. Where a vector is not shorter than
    R_a the status is ``not_a_rotation``, and the arm rests until the target has come nearer.

    Args:
        problem: The scenario as the policy knows it.
        r_a: R_a, the common length of the extended vectors. In the mixed units of J̃ᵀ f, like all that is turned.
        lambda_a: λ_a, the share of the rotation that is applied; with ``"contraction"`` -A F'(ξ*). Above 0. If left
            out, the paper's 5e-4, more on arms shorter than the paper's, so that λ_a ‖J̃‖² is the same, and no more than
            2 / ‖J̃‖², by a bound of ‖J̃‖² from the lengths of the links.
        task_weights: The diagonal of ℱ, a number or one a task coordinate. Above 0, at most 1.
        joint_weights: The diagonal of 𝒲, a number or one a joint. Above 0, at most 1.
        counter_rotation: Vectors that 𝒩 rotates: ``"joints"``, J̃ᵀ ℱ f and J̃ᵀ ℱ xᴺ; ``"task"``, ℱ f and ℱ xᴺ; or
            ``"none"``.
        deformation: ``"rotation"``, AdaptiveDeform; or ``"contraction"``, Dineva's iteration (eq. 2.9), in which R_a
            has no part.
        jacobian: ``"step"``: J̃ belongs to the joint coordinates of each inner iteration. ``"point"``: to those with
            which the grid point began, which is when xᴺ changes (the listing's ``J_Prev_a`` may mean either).
        tolerance: ‖xᴺ - f‖ up to which the status is ``converged`` instead of ``iteration_limit``, in [m] and [1].

    Raises:
        InvalidInputError: A parameter is out of its range.
        UnknownNameError: There is no such counter-rotation, deformation or Jacobian.
    """

    r_a: Annotated[float, Bounds(above=0.0)] = 100.0
    lambda_a: Annotated[float, Bounds(above=0.0)] | None = None
    task_weights: float | Sequence[float] = 1.0
    joint_weights: float | Sequence[float] = 1.0
    counter_rotation: Annotated[str, one_of(COUNTER_ROTATIONS)] = "joints"
    deformation: Annotated[str, one_of(DEFORMATIONS)] = "rotation"
    jacobian: Literal["step", "point"] = "step"
    tolerance: Annotated[float, Bounds(at_least=0.0)] = 1e-3
    #: λ_a, given or chosen.
    share: float = derived()
    #: The diagonal of ℱ. Shape (m,).
    f: FloatArray = derived()
    #: The diagonal of 𝒲. Shape (n,).
    w: FloatArray = derived()
    #: The numbers of counter-rotation and deformation in the kernel.
    codes: tuple[int, int] = derived()

    name: ClassVar[str] = "abstract_rotation"
    step = rotation_step

    def __post_init__(self) -> None:
        super().__post_init__()
        share = _share(self.problem) if self.lambda_a is None else self.lambda_a
        codes = COUNTER_ROTATIONS[self.counter_rotation], DEFORMATIONS[self.deformation]
        sizes = {"task_weights": self.problem.task.size, "joint_weights": self.problem.model.joints}
        weights = tuple(_checked_weights(name, getattr(self, name), size) for name, size in sizes.items())
        plain = {name: as_given(getattr(self, name), array) for name, array in zip(sizes, weights, strict=True)}
        self._settle(lambda_a=share, share=share, f=weights[0], w=weights[1], codes=codes, **plain)

    def memory(self, rows: int) -> Memory:
        """A :class:`RotationMemory` without a step before."""
        n, m = self.problem.model.joints, self.problem.task.size
        kept = (m, n) if self.jacobian == "point" else (0, 0)
        point, held = (np.full((rows, size), np.nan) for size in kept)
        turned = m if self.counter_rotation == "task" else n
        return RotationMemory(np.zeros((rows, turned)), np.full((rows, 2), np.nan), point, held)

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """The angles of both rotations in [rad], NaN where there was none (Fig. 6, 15 and 18), each of shape (B,)."""
        angles = RotationMemory(*self.memory_of(state)).angles
        return {"angle_counter_rotation": angles[:, 0].copy(), "angle_abstract_rotation": angles[:, 1].copy()}


def _share(problem: Problem) -> float:
    """λ_a for an arm of any size."""
    bound = jacobian_bound(problem.model, problem.task)
    return min(PAPERS_SHARE * max(1.0, _papers_bound() / bound), 2.0 / bound)


@functools.cache
def _papers_bound() -> float:
    return jacobian_bound(arms.get(PAPERS_MODEL), tasks.get(PAPERS_TASK))


def _checked_weights(name: str, value: float | Sequence[float], size: int) -> FloatArray:
    weights = per_joint(name, value, size)
    if (weights <= 0.0).any() or (weights > 1.0).any():
        raise InvalidInputError(f"{name}: expected numbers above 0 and at most 1, got {value!r}.")
    return weights
