"""Any policy, whose model is calibrated on the way by an extended Kalman filter."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar

import numpy as np

from baselines.solvers.adaptive.filter_bank import ArmFilters, ChangeModel
from ikgym.kernels import tasks as task_kernels
from ikgym.validation import Bounds, FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class Calibrated(ArmFilters):
    """Estimates joint zeros, links and axes from pairs of joint coordinates and pose, and corrects a base policy.

    An extended Kalman filter: the parameters start at 0, with the prior's standard deviations, and a measured pose y at
    the joint coordinates q improves them, θ ← θ + K (y − F(q, θ)), one component after the other, since their noises
    are independent. Parameters that no posture distinguishes stay at the prior and do no harm: only the pose matters.
    The base policy is shown the reference without the deviation F(q, θ) − F(q, 0) at the present q, see
    :class:`Corrected`.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the base policy.
        options: Its parameters; those left out have its defaults.
        history, blend: See :class:`Corrected`.
        zero, link, axis, start, keep: See :class:`ArmFilters`.
        pose_noise: Standard deviation of each part of a measured position, in [m]. Above 0.
        pose_rotation_noise: Standard deviation of each part of a measured orientation, in [rad] (or as a number, for
            parts of a rotation matrix).
        walk: How fast joint zeros change, as a payload changes them: standard deviation after a second, in [rad/√s] or
            [m/√s].
        jump: Standard deviation of a sudden change of joint zeros, in [rad] or [m], that is assumed where poses are
            farther from what was expected than noise brings them (the cumulative sum of Page 1954). 0 for none.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The base policy is a reference, or it refuses its parameters; a number is out of its range.
    """

    pose_noise: Annotated[float, Bounds(above=0.0)] = 3e-4
    pose_rotation_noise: Annotated[float, Bounds(above=0.0)] = 5e-4
    walk: Annotated[float, Bounds(at_least=0.0)] = 0.0
    jump: Annotated[float, Bounds(at_least=0.0)] = 1e-3

    name: ClassVar[str] = "calibrated"

    def variances(self) -> FloatArray:
        """See :meth:`ArmFilters.variances`; of one filter."""
        task = self.problem.task
        out = np.full((1, task.error_size), self.pose_rotation_noise**2)
        first = task.kind in (task_kernels.POSITION, task_kernels.POSE, task_kernels.AXIS)
        out[:, slice(0, 3) if first else slice(-3, None)] = self.pose_noise**2
        return out

    def changes(self) -> ChangeModel:
        """See :meth:`ArmFilters.changes`."""
        return ChangeModel(walk=self.walk**2 * self.problem.dt, jump=self.jump**2)
