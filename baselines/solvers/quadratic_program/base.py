"""Quadratic programs in the joint velocity: the parameters that all of them have."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from baselines.policy.parameters import parameter
from baselines.solvers.quadratic_program.limits import limits_with_braking
from baselines.solvers.resolved_rate.base import ResolvedRate
from ikgym.arms.limits import middle
from ikgym.validation import FloatArray, as_given, number, per_joint, read_only


class QuadraticProgramNumbers(NamedTuple):
    """The parameters of a :class:`VelocityProgram` as kernels take them.

    Attributes:
        gain: Share of the present error that is taken back in one step.
        damping: Weight of the joint motion as a share of that of the task.
        lm_damping: How much that grows with the error.
        braking_share: Share of the acceleration limit that the feedback reckons with; 0 if it does not.
        rotation_weight: Weight of the rotation against the position, in [m/rad].
        scaling: Whether the task shift is scaled.
        pull: How strongly the joints are led to a posture, in [1/s], and the posture. Shape (2, n).
        limits: See :func:`limits_with_braking`. Shape (5, n).
    """

    gain: float
    damping: float
    lm_damping: float
    braking_share: float
    rotation_weight: float
    scaling: bool
    pull: FloatArray
    limits: FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class VelocityProgram(ResolvedRate, abc.ABC):
    """Minimises task error and joint motion under the limits of position, velocity and acceleration, at each step.

    Args:
        problem: The scenario as the policy knows it, with the limits of the model.
        gain: Share of the present error that is taken back in one step; see :class:`ResolvedRate`.
        damping: Weight of the joint motion as a share of that of the task. Above 0.
        lm_damping: How much that grows with the error. At least 0.
        secondary_gain: K in [1/s], at least 0 and below 2/Δt; 0 for the smallest joint velocity.
        posture: q* in [rad] or [m]; one number, or one a joint. If left out, the model's home; where it has none, the
            middle of the limits, and joints without limits are left alone.
        braking_share: Share of the acceleration limits that braking at the reference reckons with. At most 1; 0 takes
            back the same share of all errors.
        rotation_weight: Weight of the rotation against the position, in [m/rad]: 1 rad of rotation error counts as
            much as so many metres of position error, where limits do not allow both to vanish. Above 0; it changes
            nothing in tasks without orientation. Skew and matrix coordinates count as rad.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    damping: float = parameter(3e-5, number, above=0.0)
    lm_damping: float = parameter(1e-5, number, at_least=0.0)
    secondary_gain: float = parameter(1.0, number, at_least=0.0)
    posture: float | Sequence[float] | None = None
    braking_share: float = parameter(0.5, number, at_least=0.0, at_most=1.0)
    rotation_weight: float = parameter(1.0, number, above=0.0)
    _pull: FloatArray = dataclasses.field(init=False, repr=False)

    keeps_acceleration: ClassVar[bool] = True

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

    def program_numbers(self, *, scaling: bool) -> QuadraticProgramNumbers:
        """The parameters as kernels take them.

        Args:
            scaling: Whether the task shift is scaled.
        """
        share = self.braking_share if self._brakes else 0.0
        limits = limits_with_braking(self.problem)
        return QuadraticProgramNumbers(
            self.gain, self.damping, self.lm_damping, share, self.rotation_weight, scaling, self._pull, limits
        )
