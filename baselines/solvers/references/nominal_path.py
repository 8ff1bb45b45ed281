"""References that are handed the nominal joint path, which no observation shows."""

from __future__ import annotations

import abc
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Problem, SolverPolicy
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, whole_number


class HandedPath(SolverPolicy, abc.ABC):
    """Base of policies with the fields ``seed``, which episode of a random scenario is played, and ``path``.

    The path holds the nominal joint coordinates, one row a step, in [rad] or [m]. Shape (steps + 1, n).
    """

    seed: int | None
    path: FloatArray

    reference: ClassVar[bool] = True

    @classmethod
    def for_scenario(cls, scenario: Scenario, **parameters: Any) -> Self:
        """See :meth:`SolverPolicy.for_scenario`; unlike others this policy is handed the joint path.

        Raises:
            InvalidInputError: The scenario has no joint path, or is random and there is no seed.
        """
        seed = parameters.get("seed")
        if seed is not None:
            parameters["seed"] = whole_number("seed", seed, at_least=0)
        path = scenario.nominal_joint_path(seed)
        if path is None:
            raise InvalidInputError(
                f"{cls.name} needs a nominal joint path; scenario {scenario.name!r} is given in Cartesian space."
            )
        return cls(Problem.of(scenario), path=path, **parameters)  # type: ignore[call-arg]  # a field of subclasses

    def next_rows(self, batch: Batch) -> npt.NDArray[np.int64]:
        """The rows of the path that belong to the end of the step. Shape (B,)."""
        last = len(self.path) - 1
        rows: npt.NDArray[np.int64] = np.clip(last + 1 - batch.remaining[:, 0].astype(np.int64), 0, last)
        return rows
