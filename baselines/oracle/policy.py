"""The privileged reference: plays the cheapest joint path of the whole episode that is known."""

from __future__ import annotations

import dataclasses
import functools
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from baselines.oracle.cache import solve
from baselines.oracle.optimum import Search, Starts
from baselines.oracle.stripped import NOTE, strips
from baselines.policy import Problem
from baselines.solvers.references.follow_nominal import PrivilegedPath
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import Bounds, FloatArray, Seed


@dataclasses.dataclass(frozen=True, eq=False)
class Oracle(PrivilegedPath):
    """Plays the optimum of its episode, see :func:`baselines.oracle.solve`.

    A reference, not a contender: it knows the whole trajectory and the arm itself, solves the episode when it is first
    asked (or looks the solution up on disk), and knows only the start of the episode. It plays
    the best path that the search has found; nobody certifies that there is none better.

    Args:
        problem: The scenario as the policy knows it.
        seed: Which episode of a random scenario to play.
        starts: Random starts of the search.
        generations: Generations of its local search, 0 to leave that out.
        scenario: The tracking problem.

    Raises:
        InvalidInputError: The scenario is random and there is no seed, its drives or sensors are not ideal, or a
            number is out of range.
    """

    seed: Seed | None = None
    starts: Starts = Search.starts
    generations: Annotated[int, Bounds(at_least=0)] = Search.generations
    scenario: Scenario = dataclasses.field(kw_only=True)

    name: ClassVar[str] = "oracle"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.seed is None and (self.scenario.random or self.scenario.plant.draws_arm):
            raise InvalidInputError(f"Scenario {self.scenario.name!r} is random: a seed says which episode is meant.")
        if strips(self.scenario):
            raise InvalidInputError(
                f"{self.name} plays a joint path that was found {NOTE}; scenario {self.scenario.name!r}: expected "
                f"ideal ones, got {self.scenario.plant}. The reference there is `told`."
            )

    @classmethod
    def for_scenario(cls, scenario: Scenario, **parameters: Any) -> Self:
        """See :meth:`SolverPolicy.for_scenario`; unlike others this policy is handed the scenario itself."""
        return cls(Problem.of(scenario), scenario=scenario, **parameters)

    @functools.cached_property
    def path(self) -> FloatArray:  # type: ignore[override]  # a field elsewhere; here it is solved when first needed
        """The optimum's joint coordinates, one row a step, in [rad] or [m]. Shape (steps + 1, n)."""
        optimum = solve(self.scenario, self.seed or 0, Search(starts=self.starts, generations=self.generations))
        # Nobody goes to row 0.
        path = np.vstack([optimum.q[:1], optimum.q])
        path.flags.writeable = False
        return path
