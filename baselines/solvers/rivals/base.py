"""Base of solvers of other projects: their import, their input, and the objects that they reuse."""

from __future__ import annotations

import abc
import dataclasses
import importlib
import sys
import threading
import weakref
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Solution, SolverPolicy, statuses
from baselines.status import Status
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.kernels.kinematics import forward
from ikgym.validation import FloatArray

#: Tasks whose coordinates are a whole pose: a rotation, row by row, and a position.
WHOLE_POSES = ("pose", "matrix")


class Target(NamedTuple):
    """Where a solver has to move one arm.

    The target is the model's present pose, moved as the tool has to move from its measured pose to the reference.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        qdot: Joint velocities last applied, in [rad/s] or [m/s]. Shape (n,).
        start: Joint coordinates at the start of the episode. Shape (n,).
        rotation: Of the model's tool at the end of the step; the part that the task leaves free stays. Shape (3, 3).
        position: Of the model's tool at the end of the step, in [m]. Shape (3,).
    """

    q: FloatArray
    qdot: FloatArray
    start: FloatArray
    rotation: FloatArray
    position: FloatArray


class StartMemory(NamedTuple):
    """Start of the episode.

    Attributes:
        start: Joint coordinates in [rad] or [m]. Shape (B, n).
        known: Whether there was a step before. Shape (B,).
    """

    start: FloatArray
    known: npt.NDArray[np.bool_]


#: One step: joint velocities, or None where the solver finds none.
Step = Callable[[Target], FloatArray | None]

#: The packages' objects of the policies, for each thread: they change from call to call.
_made = threading.local()


@dataclasses.dataclass(frozen=True, eq=False)
class Rival(SolverPolicy, abc.ABC):
    """Base of the solvers of other projects.

    The target leads from the measured pose to the reference pose of the next step, which holds the motion of the
    reference already: nothing is to be fed forward besides. Packages work out poses from the model, so the target is
    corrected by the difference of the model's pose from the measured one. Where a solver finds no
    joint velocities the arm is stopped for this step, and the status is ``diverged``.

    Args:
        problem: The scenario as the policy knows it.

    Raises:
        InvalidInputError: The task is none of :attr:`tasks`, or the package cannot have such an arm.
        MissingDependencyError: The package is not installed.
    """

    rival: ClassVar[bool] = True
    #: Threads would wait for each other: the packages' Python code holds the interpreter lock.
    grain: ClassVar[int] = sys.maxsize
    #: Imported modules, and their names in :mod:`pip`.
    package: ClassVar[str]
    distribution: ClassVar[str]
    #: Tasks that it can be asked for.
    tasks: ClassVar[tuple[str, ...]] = (*WHOLE_POSES, "position", "axis")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.problem.task.name not in self.tasks:
            raise InvalidInputError(
                f"{self.name}: expected a scenario of the task {' or '.join(map(repr, self.tasks))}, "
                f"got {self.problem.task.name!r}."
            )
        self.import_package()

    @classmethod
    def import_package(cls, module: str | None = None) -> Any:
        """The package, or a module of it.

        Raises:
            MissingDependencyError: It is not installed.
        """
        try:
            return importlib.import_module(module or cls.package)
        except ImportError as error:
            raise MissingDependencyError(
                f'The policy {cls.name!r} needs {cls.distribution}: pip install "ikgym[rivals]"'
            ) from error

    @property
    def model(self) -> Arm:
        """The model, whose velocity limits are those of the actions as well."""
        return self.problem.model.replace(velocity_limit=self.problem.largest_qdot)

    @abc.abstractmethod
    def make_step(self) -> Step:
        """The solver, made anew: its objects are used by one thread alone."""

    def memory(self, rows: int) -> Memory:
        """A :class:`StartMemory` without a step before."""
        return StartMemory(np.zeros((rows, self.problem.model.joints)), np.zeros(rows, dtype=np.bool_))

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`; row by row."""
        start, known = memory
        start, step = np.where(known[:, None], start, batch.q), self._step()
        qdot, status = np.zeros(batch.q.shape), statuses(len(start))
        for row, observed in enumerate(zip(batch.q, batch.qdot, start, batch.pose, batch.nominal[:, 0], strict=True)):
            found = step(self.target(*observed))
            if found is None:
                status[row] = Status.DIVERGED
            else:
                qdot[row] = found
        kept = StartMemory(start, np.ones(len(start), dtype=np.bool_))
        return Solution(qdot, kept, status, np.ones(len(start), dtype=np.int64))

    def target(
        self, q: FloatArray, qdot: FloatArray, start: FloatArray, pose: FloatArray, nominal: FloatArray
    ) -> Target:
        """The observation of one arm, from its measured task coordinates and those of the next step; shapes (m,)."""
        rotation, position = np.empty((3, 3)), np.empty(3)
        forward(self.problem.model.chain, q, rotation, position)
        if self.problem.task.name in WHOLE_POSES:
            rotation = nominal[:9].reshape(3, 3) @ pose[:9].reshape(3, 3).T @ rotation
        elif self.problem.task.name == "axis":
            rotation = turn(pose[:3], nominal[:3]) @ rotation
        return Target(q, qdot, start, rotation, position + (nominal[-3:] - pose[-3:]))

    def _step(self) -> Step:
        made = _made.__dict__.setdefault("steps", weakref.WeakKeyDictionary())
        if self not in made:
            made[self] = self.make_step()
        step: Step = made[self]
        return step


def turn(axis: FloatArray, other: FloatArray) -> FloatArray:
    """The rotation that turns a unit vector into another one, not opposite to it, by the shortest way. Shape (3, 3)."""
    across = np.cross(axis, other)
    skew = np.array([[0.0, -across[2], across[1]], [across[2], 0.0, -across[0]], [-across[1], across[0], 0.0]])
    out: FloatArray = np.eye(3) + skew + skew @ skew / (1.0 + axis @ other)
    return out
