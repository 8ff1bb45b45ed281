"""The whole orientation behind skew coordinates: their 90° ambiguity, resolved by the motion before and after."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Problem, Solution
from baselines.wrapper import NamedWrapper
from ikgym import tasks
from ikgym.exceptions import InvalidInputError
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inlined, kernel
from ikgym.kernels.kinematics import forward
from ikgym.scenarios.preview import furthest
from ikgym.validation import FloatArray


class OrientationMemory(NamedTuple):
    """Memory of :func:`resolve_orientation`.

    Attributes:
        cosines: cos θ of the last two nominal orientations. Shape (B, 2).
        known: Whether they are known. Shape (B,).
    """

    cosines: FloatArray
    known: npt.NDArray[np.bool_]


def full_problem(problem: Problem) -> Problem:
    """The problem with whole poses instead of skew coordinates.

    Raises:
        InvalidInputError: Its task is not `skew`.
    """
    if problem.task.kind != task_kernels.SKEW:
        raise InvalidInputError(
            f"expected the task 'skew', whose orientation is ambiguous beyond 90°, got {problem.task.name!r}."
        )
    return problem.replace(task=tasks.get("pose"))


def start_memory(rows: int) -> OrientationMemory:
    """The memory at the start of an episode.

    Args:
        rows: B.
    """
    return OrientationMemory(np.zeros((rows, 2)), np.zeros(rows, dtype=np.bool_))


def resolve_orientation(problem: Problem, batch: Batch, memory: OrientationMemory) -> tuple[Batch, OrientationMemory]:
    """Whole poses for skew coordinates.

    The skew part of a rotation by θ about a is sin θ · a: it is the same for θ and π − θ, and stationary at 90°,
    where its Jacobian is singular although the arm is not. A solver that knows nothing else may continue there or turn
    back, and follows the right coordinates with the wrong orientation from there on. But a nominal motion has no
    reason to turn back just at 90°. So the sign of cos θ, which is all that is missing, is followed from step to step:
    of the two orientations that coordinates allow, the nominal one is that whose cos θ continues its change. At the
    start it is taken to be that of the arm, which the joint coordinates determine.

    Args:
        problem: With the task `skew`.
        batch: Observations, `nominal` at the steps 1, 2, … ahead. Shapes (B, …).
        memory: Result of :func:`start_memory` or of the last call.

    Returns:
        The observations as the task `pose` has them, and the next memory.
    """
    rows, ahead = batch.nominal.shape[:2]
    pose, nominal = np.empty((rows, 12)), np.empty((rows, ahead, 12))
    cosines = memory.cosines.copy()
    resolve_rows(problem.model.chain, batch.q, batch.pose, batch.nominal, memory.known, cosines, pose, nominal)
    return batch._replace(pose=pose, nominal=nominal), OrientationMemory(cosines, np.ones(rows, dtype=np.bool_))


@kernel
def resolve_rows(chain, q, pose, nominal, known, cosines, whole_pose, whole_nominal):
    """See :func:`resolve_orientation`, row by row.

    Args:
        chain: The model of the arm.
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        pose: Measured skew coordinates. Shape (B, 6).
        nominal: Skew coordinates of the next points. Shape (B, p, 6).
        known: Whether the cosines are known. Shape (B,).
        cosines: cos θ of X^N(k - 1) and X^N(k); becomes that of X^N(k) and X^N(k + 1). Shape (B, 2).
        whole_pose: Receives the frames of the arm. Shape (B, 12).
        whole_nominal: Receives those of the next points. Shape (B, p, 12).
    """
    rotation, position = np.empty((3, 3)), np.empty(3)
    for row in range(q.shape[0]):
        forward(chain, q[row], rotation, position)
        cosine = resolve_one(pose[row], 0.5 * (rotation[0, 0] + rotation[1, 1] + rotation[2, 2] - 1.0), whole_pose[row])
        before, now = (cosines[row, 0], cosines[row, 1]) if known[row] else (cosine, cosine)
        for i in range(nominal.shape[1]):
            following = resolve_one(nominal[row, i], 2.0 * now - before, whole_nominal[row, i])
            before, now = now, following
            if i == 0:
                cosines[row, 0], cosines[row, 1] = before, now


@inlined
def resolve_one(coordinates, expected, frame):
    """The frame of skew coordinates, the one of two whose cos θ has the sign of ``expected``: shapes (6,), (12,).

    Returns:
        Cos θ.
    """
    x, y, z = -coordinates[2], coordinates[1], -coordinates[0]  # sin θ · a
    square = min(x * x + y * y + z * z, 1.0)
    cosine = math.copysign(math.sqrt(1.0 - square), expected)
    # (1 - cos θ) / sin² θ, the weight of the symmetric part, written so that small angles lose no digits. At 180° the
    # coordinates vanish, and do not determine the axis.
    weight = 1.0 / (1.0 + cosine) if cosine > 0.0 else (1.0 - cosine) / max(square, 1e-300)
    frame[0], frame[1], frame[2] = cosine + weight * x * x, weight * x * y - z, weight * x * z + y
    frame[3], frame[4], frame[5] = weight * x * y + z, cosine + weight * y * y, weight * y * z - x
    frame[6], frame[7], frame[8] = weight * x * z - y, weight * y * z + x, cosine + weight * z * z
    for i in range(3):
        frame[9 + i] = coordinates[3 + i]
    return cosine


@dataclasses.dataclass(frozen=True, eq=False)
class FullOrientation(NamedWrapper):
    """Lets a policy see whole poses, where the scenario shows the skew coordinates of Varga 2021.

    Skew coordinates are the same for a rotation by θ and by 180° − θ, and their Jacobian is singular at 90°. That is
    where most solvers lose the arm. :func:`resolve_orientation` resolves this 90° ambiguity, and the inner
    policy is given the task `pose`: it tracks the same motion without it. The cost stays that of the skew coordinates.
    This method is of this project.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the inner policy.
        options: Its parameters; those left out have its defaults.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The task is not `skew`, the policy is a reference or made from others, or it refuses its
            parameters.
    """

    name: ClassVar[str] = "full_orientation"
    nests: ClassVar[bool] = False

    def inner_problem(self) -> Problem:
        """The problem with whole poses."""
        return full_problem(self.problem)

    def own_memory(self, rows: int) -> OrientationMemory:
        """See :func:`start_memory`."""
        return start_memory(rows)

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        outer, inside = self.split(memory)
        shown = batch._replace(nominal=batch.nominal[:, : furthest(self.inner.preview)])
        seen, kept = resolve_orientation(self.problem, shown, outer)
        step = self.ask(seen, inside)
        return self.solution(step.qdot, kept, step)
