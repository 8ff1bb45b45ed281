"""Any policy, with a reference that is shifted by the difference of measured and predicted poses."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch
from baselines.solvers.adaptive.corrected import Corrected, Measurement
from baselines.solvers.adaptive.deviation import SIZE, missing_deviation, move_deviation
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import kernel
from ikgym.kernels.kinematics import forward
from ikgym.validation import Bounds, FloatArray


class OffsetMemory(NamedTuple):
    """Estimate of the deviation.

    Attributes:
        before: See :class:`Measurement`. Shape (B, h, n).
        age: See :class:`Measurement`. Shape (B, 1).
        rest: Part of the change of the estimate that is not blended in yet. Shape (B, 6).
        deviation: See :mod:`baselines.solvers.adaptive.deviation`. Shape (B, 6).
        measured: How many poses have been measured. Shape (B,).
    """

    before: FloatArray
    age: FloatArray
    rest: FloatArray
    deviation: FloatArray
    measured: npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, eq=False)
class OffsetFree(Corrected):
    """Takes the filtered difference between measured and modelled pose from the reference of a base policy.

    The difference is an output disturbance that is taken to stay as it is, which leaves no offset where it does
    (Rawlings, Mayne and Diehl 2017, section 1.5: offset-free model predictive control). Its filter is that of first
    order, d ← d + g (y − F(q) − d), on the rotation group for the orientation, with the joint coordinates of the moment
    when the pose was measured. The first measurements count alike, g = 1/k for the k-th, until that is below the gain.

    The deviation of a wrong model differs from posture to posture: a large gain follows it and lets the noise through,
    a small one does the opposite. :class:`Calibrated` learns errors that are the same in all postures.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the base policy.
        options: Its parameters; those left out have its defaults.
        history: See :class:`Corrected`.
        blend: See :class:`Corrected`.
        gain: g, the share of the difference that a measurement takes over, from above 0 to 1.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The base policy is a reference, or it refuses its parameters; the history or the gain is out
            of its range.
    """

    gain: Annotated[float, Bounds(above=0.0, at_most=1.0)] = 0.05

    name: ClassVar[str] = "offset_free"

    def own_memory(self, rows: int) -> OffsetMemory:
        """See :meth:`Wrapper.own_memory`."""
        return OffsetMemory(*self.sensors(rows), np.zeros((rows, SIZE)), np.zeros(rows, np.int64))

    def learn(
        self, batch: Batch, measured: Measurement, outer: OffsetMemory, out: FloatArray, old: FloatArray
    ) -> OffsetMemory:
        """See :meth:`Corrected.learn`."""
        old[:] = out[:] = outer.deviation
        count = outer.measured + measured.new
        chain, kind = self.problem.model.chain, self.problem.task.kind
        filter_rows(chain, kind, self.gain, batch.pose, measured.q, measured.new, count, out)
        return outer._replace(deviation=out.copy(), measured=count)


@kernel
def filter_rows(chain, kind, gain, pose, q, new, count, deviation):
    """Takes the measurements in, row by row.

    Args:
        chain: The model of the arm.
        kind: Of task coordinates.
        gain: The least share of a difference that is taken over.
        pose: Measured task coordinates. Shape (B, m).
        q: Joint coordinates where they were measured. Shape (B, n).
        new: Whether they are new. Shape (B,).
        count: How many measurements there have been with this one. Shape (B,).
        deviation: Changed in place. Shape (B, 6).
    """
    rotation, position, modelled, missing = np.empty((3, 3)), np.empty(3), np.empty(pose.shape[1]), np.empty(SIZE)
    for row in range(q.shape[0]):
        if new[row]:
            forward(chain, q[row], rotation, position)
            task_kernels.coordinates(kind, rotation, position, modelled)
            missing_deviation(kind, pose[row], modelled, deviation[row], missing)
            share = max(gain, 1.0 / count[row])
            for i in range(SIZE):
                missing[i] *= share
            move_deviation(kind, missing, deviation[row])
