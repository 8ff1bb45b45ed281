"""Base of solvers of other projects: their import, their input, and the objects that they reuse."""

from __future__ import annotations

import abc
import dataclasses
import functools
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
from ikgym.validation import FloatArray

#: Tasks whose coordinates are a whole pose: a rotation, row by row, and a position.
WHOLE_POSES = ("pose", "matrix")


class Target(NamedTuple):
    """Reference pose at the end of the step.

    Attributes:
        rotation: Of the tool; what the task leaves free is that of the arm as it stands. Shape (3, 3).
        position: In [m]. Shape (3,).
    """

    rotation: FloatArray
    position: FloatArray


class Seen(NamedTuple):
    """Observation of one arm for a solver.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        qdot: Joint velocities last applied, in [rad/s] or [m/s]. Shape (n,).
        start: Joint coordinates at the start of the episode. Shape (n,).
        target: Where the tool is to be.
    """

    q: FloatArray
    qdot: FloatArray
    start: FloatArray
    target: Target


class StartMemory(NamedTuple):
    """Start of the episode.

    Attributes:
        start: Joint coordinates in [rad] or [m]. Shape (B, n).
        known: Whether there was a step before. Shape (B,).
    """

    start: FloatArray
    known: npt.NDArray[np.bool_]


#: One step: joint velocities, or None where the solver finds none.
Step = Callable[[Seen], FloatArray | None]

#: The packages' objects of the policies, for each thread: they change from call to call.
_made = threading.local()


@dataclasses.dataclass(frozen=True, eq=False)
class Rival(SolverPolicy, abc.ABC):
    """Base of the solvers of other projects.

    The target is the reference pose of the next step, which holds the motion of the reference already: nothing is to be
    fed forward besides. Poses are worked out by the package from the model, and the measured pose is not looked at.
    Where a solver finds no joint velocities the arm is stopped for this step, and the status is ``diverged``.

    Args:
        problem: The scenario as the policy knows it.

    Raises:
        InvalidInputError: The task is none of :attr:`tasks`, or the package cannot have such an arm.
        MissingDependencyError: The package is not installed.
    """

    rival: ClassVar[bool] = True
    #: Threads would wait for each other: what the packages do in Python holds the interpreter lock.
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
        self.imported()

    @classmethod
    def imported(cls, module: str | None = None) -> Any:
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
        step, rows = self._step(), len(batch.q)
        start = np.where(known[:, None], start, batch.q)
        qdot, status = np.zeros(batch.q.shape), statuses(rows)
        for row in range(rows):
            target = self._target(batch.nominal[row, 0], batch.q[row])
            found = step(Seen(batch.q[row], batch.qdot[row], start[row], target))
            if found is None:
                status[row] = Status.DIVERGED
            else:
                qdot[row] = found
        kept = StartMemory(start, np.ones(rows, dtype=np.bool_))
        return Solution(qdot, kept, status, np.ones(rows, dtype=np.int64))

    def _step(self) -> Step:
        made = _made.__dict__.setdefault("steps", weakref.WeakKeyDictionary())
        if self not in made:
            made[self] = self.make_step()
        step: Step = made[self]
        return step

    @functools.cached_property
    def _target(self) -> Callable[[FloatArray, FloatArray], Target]:
        """Turns reference coordinates and joint coordinates into a target."""
        if self.problem.task.name in WHOLE_POSES:
            return lambda nominal, q: Target(nominal[:9].reshape(3, 3), nominal[9:])
        forward, axis = self.problem.model.forward, self.problem.task.name == "axis"

        def target(nominal: FloatArray, q: FloatArray) -> Target:
            rotation = forward(q)[0]
            return Target(turned(rotation, nominal[:3]) if axis else rotation, nominal[-3:])

        return target


def turned(rotation: FloatArray, axis: FloatArray) -> FloatArray:
    """A rotation, turned by the shortest way so that its z axis is another one.

    Args:
        rotation: A rotation matrix. Shape (3, 3).
        axis: The z axis to be, a unit vector that is not opposite to the present one. Shape (3,).
    """
    across = np.cross(rotation[:, 2], axis)
    skew = np.array([[0.0, -across[2], across[1]], [across[2], 0.0, -across[0]], [-across[1], across[0], 0.0]])
    out: FloatArray = rotation + skew @ rotation + skew @ skew @ rotation / (1.0 + rotation[:, 2] @ axis)
    return out
