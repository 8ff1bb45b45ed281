"""Matrix-inversion-free inverse kinematics by fixed-point transformation (Faitli and Tar 2018; Khan and Tar 2020)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np

from baselines.policy import Memory
from baselines.policy.compiled import CompiledPolicy, derived
from baselines.solvers.arm_size import error_weights, jacobian_bound, length, radian
from baselines.solvers.fixed_point.iteration import (
    TRANSFORMATIONS,
    FixedPointMemory,
    fixed_point_step,
)
from ikgym.exceptions import InvalidInputError
from ikgym.validation import Bounds, FloatArray, IntArray, one_of, read_only, whole_number

# The length in [m] of the paper's arm, to which its A belongs; on a shorter one it grows with 1/length².
PAPERS_LENGTH = 1.3


@dataclasses.dataclass(frozen=True, eq=False)
class FixedPoint(CompiledPolicy):
    """Iterates q ← q + [F(A ‖h‖ + ξ*) - ξ*] h/‖h‖ with h = Jᵀ (f(q) - x), whose fixed point solves the task (eq. 1).

    F is a function with an attractive fixed point ξ*, here the paper's F(ξ) = slope · ξ + D. D cancels, and ξ/2 + D
    makes the step q + (A/2) Jᵀ (f(q) - x): the transposed Jacobian. Around a solution the error of q is multiplied by
    I + F'(ξ*) A JᵀJ (Khan 2020, eq. 2.6): it contracts for -2/σ_max² < F'(ξ*) A < 0, that is for
    |A| < 4/σ_max² in the paper, in all directions in which J has rank. In the others nothing moves, which is the
    method's good behaviour at singularities, and why it leaves a path there that continues along them.

    The iterations of a step use the model alone: a pose is never measured, so that a wrong model's error stays.
    Where f - x is a rotation error (task ``pose``) it takes the place of f(q) - x. Position and orientation are weighed
    against each other: h is Jᵀ W² (f(q) - x), and σ_max that of W J, with 1 in W for positions and a length ℓ for
    orientations; the paper, where there are positions only, has none.

    Args:
        problem: The scenario as the policy knows it.
        transformation: ``"transpose"``: h = Jᵀ (f(q) - x), as above. ``"none"``: h = f(q) - x, Dineva's form
            (Khan 2020, eq. 2.5), which converges where all eigenvalues of F'(ξ*) A J have negative real parts, as
            those of few arms do. ``"sign"``: h = σ (f(q) - x), σ = ±1 (Khan 2020, eq. 2.8; he had no success with it
            beyond 2 joints). The paper says only that σ depends on the direction of the previous step; it is read as
            the one-dimensional case of his 𝒩: σ = -1 where f - x points away from the one before. The other reading,
            ``"sign_by_growth"``: σ changes where the step before has led further away, so that ‖f - x‖ has grown.
            All but the first use no Jacobian, and need a component of the error for each joint.
        slope: The factor in F; ½ in the paper.
        a: A, negative with a rising F and ``"transpose"``. If left out, the paper's -1 where 2/σ_max² allows it, and
            -2/(|F'(ξ*)| ‖W J‖²) where it may not, from a bound of ‖W J‖² by the lengths of the links, with prismatic
            joints at home. On arms below the 1.3 m of the paper's, -1 becomes -(1.3 m / length)².
        d: D.
        iterations: Iterations in one step; all of them are made.
        tolerance: ‖f(q) - x‖ after the last up to which the status is ``converged``, in [m] and [rad] or [1].
        components: Where no Jacobian is used, the number of the error's component, from 0, that corrects each joint;
            all in their order if left out. An arm with 2 joints in a plane has (0, 1).
        length: ℓ, the length that 1 rad, or 1 in a rotation matrix, counts as, in [m]; only with ``"transpose"``.
            Above 0. If left out, chosen for the model, see :func:`baselines.solvers.arm_size.radian`.

    Raises:
        InvalidInputError: A parameter is out of its range, or the transformation does not suit the task.
        UnknownNameError: There is no such transformation.
    """

    transformation: Annotated[str, one_of(TRANSFORMATIONS)] = "transpose"
    slope: Annotated[float, Bounds(above=-1.0, below=1.0)] = 0.5
    a: Annotated[float, Bounds()] | None = None
    d: Annotated[float, Bounds()] = 0.3
    iterations: Annotated[int, Bounds(at_least=1)] = 10
    tolerance: Annotated[float, Bounds(at_least=0.0)] = 1e-6
    components: Sequence[int] | None = None
    length: Annotated[float, Bounds(above=0.0)] | None = None
    #: The number of the transformation in the kernel.
    code: int = derived()
    #: A, given or chosen.
    factor: float = derived()
    #: ξ* (Faitli 2018, section 2.2, with the slope ½).
    fixed_point: float = derived()
    #: Which component of f - x corrects each joint where there is no Jacobian. Shape (n,).
    corrected_by: IntArray = derived()
    #: Weights of the squares of the components of f - x. Shape (e,).
    weights: FloatArray = derived()

    name: ClassVar[str] = "fixed_point"
    step = fixed_point_step

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle(components=self._check_components(), length=self._check_length())
        if self.slope == 0.0:
            raise InvalidInputError("slope: expected a number between -1 and 1 other than 0, got 0.")
        factor = self._default_factor() if self.a is None else self.a
        if factor == 0.0:
            raise InvalidInputError("a: expected a number other than 0, got 0: nothing would move.")
        corrected_by = np.array(self.components or range(self.problem.model.joints))
        corrected_by.flags.writeable = False
        self._settle(
            a=factor,
            code=TRANSFORMATIONS[self.transformation],
            factor=factor,
            fixed_point=self.d / (1.0 - self.slope),
            corrected_by=corrected_by,
            weights=read_only(error_weights(self.problem.task, self._metres)),
        )

    def memory(self, rows: int) -> Memory:
        """A :class:`FixedPointMemory` without a step before."""
        if self.transformation == "sign_by_growth":
            return FixedPointMemory(np.tile([1.0, np.inf], (rows, 1)))
        return FixedPointMemory(np.zeros((rows, self.problem.model.joints if self.transformation == "sign" else 0)))

    def _check_components(self) -> tuple[int, ...] | None:
        size, joints = self.problem.task.error_size, self.problem.model.joints
        if self.components is None:
            if self.transformation != "transpose" and size != joints:
                raise InvalidInputError(
                    f"transformation {self.transformation!r} needs as many components of the error as joints, or "
                    f"`components`; task {self.problem.task.name!r} has {size}, arm {self.problem.model.name!r} "
                    f"{joints} joints."
                )
            return None
        if self.transformation == "transpose":
            raise InvalidInputError("components: expected none with transformation 'transpose', which uses all.")
        listed = self.components if isinstance(self.components, Sequence | np.ndarray) else (self.components,)
        given = tuple(whole_number("components", one, at_least=0) for one in listed)
        if len(given) != joints or len(set(given)) != joints or max(given) >= size:
            raise InvalidInputError(
                f"components: expected {joints} different numbers below {size}, one a joint, got {given}."
            )
        return given

    def _check_length(self) -> float | None:
        if self.transformation == "transpose":
            return radian(self.problem.model) if self.length is None else self.length
        if self.length is not None:
            raise InvalidInputError("length: expected none but with transformation 'transpose', which weighs errors.")
        return None

    @property
    def _metres(self) -> float:
        """ℓ; 1 m where nothing is weighed."""
        return 1.0 if self.length is None else self.length

    def _jacobian_bound(self) -> float:
        """A number that ‖W J‖² does not exceed, with prismatic joints at home."""
        return jacobian_bound(self.problem.model, self.problem.task, self._metres)

    def _default_factor(self) -> float:
        """The paper's A, or as much of it as is sure to contract with the transposed Jacobian."""
        papers = 1.0
        if self.transformation == "transpose":  # an arm without length has nothing but turns
            papers = max(1.0, (PAPERS_LENGTH / (length(self.problem.model) or PAPERS_LENGTH)) ** 2)
        size = min(papers, 2.0 / (abs(self.slope) * self._jacobian_bound()))
        return -math.copysign(size, self.slope)
