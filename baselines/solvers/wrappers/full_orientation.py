"""Any policy, shown whole poses where the scenario shows skew coordinates."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from baselines import registry
from baselines.policy import Batch, Memory, Operations, Solution, SolverPolicy
from baselines.solvers.wrappers import orientation
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview
from ikgym.scenarios.scenario import furthest
from ikgym.validation import FloatArray, known_names


@dataclasses.dataclass(frozen=True, eq=False)
class FullOrientation(SolverPolicy):
    """Lets a policy see whole poses, where the scenario shows the skew coordinates of Varga 2021.

    Skew coordinates fold the orientations beyond a rotation by 90° onto those before it, and their Jacobian is singular
    in between. That is where most solvers lose the arm. :func:`orientation.unfold` tells the whole orientation
    from what is shown, and the policy inside is given the task `pose`: it tracks the same motion without the fold. The
    cost stays that of the skew coordinates. This method is of this project.

    Args:
        problem: What the policy is told of the scenario.
        policy: The name of the policy inside.
        options: Its parameters; those left out have its defaults.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The task is not `skew`, the policy is a reference or made from others, or it refuses its
            parameters.
    """

    policy: str = "dls"
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    inner: SolverPolicy = dataclasses.field(init=False, repr=False)

    name: ClassVar[str] = "full_orientation"
    composed: ClassVar[bool] = True

    def __post_init__(self) -> None:
        kind = registry.get(self.policy)
        if kind.reference or kind.composed:
            what = "reference" if kind.reference else "policy that is made from others"
            raise InvalidInputError(f"policy: expected one that acts on what it sees, got the {what} {kind.name!r}.")
        if not isinstance(self.options, Mapping):
            raise InvalidInputError(f"options: expected the parameters of {kind.name} by name, got {self.options!r}.")
        known_names(f"parameter of {kind.name}", self.options, kind.parameter_names())
        inner = kind(orientation.whole(self.problem), **self.options)
        object.__setattr__(self, "inner", inner)
        object.__setattr__(self, "options", inner.parameters)

    @property
    def preview(self) -> Preview:
        """That of the policy inside."""
        return self.inner.preview

    def memory(self, rows: int) -> Memory:
        """That of the unfolding, see :func:`orientation.memory`, and that of the policy inside."""
        return *orientation.memory(rows), *self.inner.memory(rows)

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        shown = batch._replace(nominal=batch.nominal[:, : furthest(self.inner.preview)])
        seen, kept = orientation.unfold(self.problem, shown, memory[:2])
        # Not its solve, so that what is not finite or beyond the limit is dealt with as if it were alone.
        action, (status, iterations, *inside) = self.inner.act(seen, memory[2:])
        return Solution(action * self.problem.velocity_limit, (*kept, *inside), status, iterations)

    def operations(self, state: Memory) -> Operations:
        """Those of the policy inside, which may keep count in its memory, and the orientation of the arm."""
        return Operations(*self._counted(self.inner.operations(_inner_state(state))))

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """What the policy inside shows of itself."""
        return self.inner.diagnostics(_inner_state(state))

    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """Those of the policy inside, and the orientation of the arm."""
        return self._counted(self.inner.count(iterations))

    def _counted(self, inside: tuple[Any, ...]) -> tuple[Any, ...]:
        return np.asarray(inside[0]) + 1, *inside[1:]


def _inner_state(state: Memory) -> Memory:
    return *state[:2], *state[4:]
