"""Quadratic programs in the joint velocity: the parameters that all of them have."""

from __future__ import annotations

import abc
import dataclasses
import math
from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np

from baselines.policy.compiled import derived
from baselines.solvers.resolved_rate.base import ResolvedRate
from ikgym.arms.limits import middle
from ikgym.validation import Bounds, FloatArray, as_given, per_joint, read_only

#: Largest motion to the posture, as a share of the joint motion that the task asks for.
SECONDARY_SHARE = 0.5
#: Largest one of a slow joint, as a share of its velocity limit.
SLOW_SHARE = 0.15
#: Gains in [1/s] by default, where that motion is limited, and elsewhere.
SOFT_GAIN, GAIN = 2.5, 1.0


@dataclasses.dataclass(frozen=True, eq=False)
class VelocityProgram(ResolvedRate, abc.ABC):
    """Minimises task error and joint motion under the limits of position, velocity and acceleration, at each step.

    Args:
        problem: The scenario as the policy knows it, with the limits of the model.
        gain: Fraction of the error corrected per step; see :class:`ResolvedRate`.
        damping: Weight of the joint motion as a share of that of the task. Above 0.
        lm_damping: How much that grows with the error. At least 0.
        secondary_gain: K in [1/s] of the way to a posture, at least 0 and below 2/Δt; 0 for the smallest joint
            velocity. Where :attr:`soft`, that motion is at most half as large as the joint motion that reference and
            error ask for, so that an arm at rest stays at rest, and it takes at most 0.15 of the velocity limit of a
            slow joint. By default 2.5 there, else 1, and at most 1/Δt.
        posture: q* in [rad] or [m]; one number, or one a joint. If left out, the model's home; where it has none, the
            middle of the limits, and joints without limits are left alone.
        braking_share: Share of the acceleration limits assumed for braking at the reference. At most 1; 0 corrects
            the same fraction of all errors.
        rotation_weight: Weight of the rotation against the position, in [m/rad]: 1 rad of rotation error counts as
            much as that many metres of position error, where limits do not allow both to vanish. Above 0; it changes
            nothing in tasks without orientation. Skew and matrix coordinates count as rad.
        joint_weights: w, above 0: how costly the motion of a joint is; only ratios count. One number, or one a joint.
            If left out, (v_max / v)^1.1 of the largest joint velocities v for slow joints, with v < v_max / 3, 1 for
            others, so that slow joints do little of what others can do; equal ones where the model has no velocity
            limits, and among bodies, where the others need them to give way.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    damping: Annotated[float, Bounds(above=0.0)] = 3e-5
    lm_damping: Annotated[float, Bounds(at_least=0.0)] = 1e-5
    secondary_gain: Annotated[float, Bounds(at_least=0.0)] | None = None
    posture: float | Sequence[float] | None = None
    joint_weights: float | Sequence[float] | None = None
    braking_share: Annotated[float, Bounds(at_least=0.0, at_most=1.0)] = 0.5
    rotation_weight: Annotated[float, Bounds(above=0.0)] = 1.0
    #: The part of the acceleration limits that the feedback assumes for braking; 0 where there are none.
    braking: float = derived()
    #: Largest secondary motion of the joints relative to the primary one; inf for any.
    secondary_share: float = derived()
    #: Largest secondary velocities of the joints in [rad/s] or [m/s]; inf for any. Shape (n,).
    secondary_limit: FloatArray = derived()
    #: Weights of the joints. Shape (n,).
    weights: FloatArray = derived()
    #: Gains to the posture in [1/s], and the posture. Shape (2, n).
    pull: FloatArray = derived()

    keeps_acceleration: ClassVar[bool] = True
    keeps_jerk: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.secondary_gain is not None:
            self.check_secondary_gain(self.secondary_gain)
        target, gains = self._posture()
        slow = self.weights_of(None) > 1.0
        brakes = np.isfinite(self.problem.model.acceleration_limit).any()
        self._settle(
            braking=self.braking_share if brakes else 0.0,
            secondary_share=SECONDARY_SHARE if self.soft else math.inf,
            secondary_limit=read_only(np.where(slow, SLOW_SHARE * self.problem.largest_qdot, math.inf)),
            weights=self.weights_of(1.0 if self.among_bodies and self.joint_weights is None else self.joint_weights),
            pull=read_only(np.array([gains, target])),
        )

    def _posture(self) -> tuple[FloatArray, FloatArray]:
        """Target posture of the joints, and gain in [1/s]. Shapes (n,)."""
        model = self.problem.model
        gain = min(SOFT_GAIN if self.soft else GAIN, 1.0 / self.problem.dt)
        everywhere = np.full(model.joints, gain if self.secondary_gain is None else self.secondary_gain)
        if self.posture is not None:
            posture = per_joint("posture", self.posture, model.joints)
            object.__setattr__(self, "posture", as_given(self.posture, posture))
            return posture, everywhere
        if model.home is not None:
            return model.home, everywhere
        limited, posture = middle(model)
        return posture, np.where(limited, everywhere, 0.0)

    @property
    def soft(self) -> bool:
        """Whether the motion to the posture is limited; among bodies the arm has to give way in time."""
        return not self.among_bodies
