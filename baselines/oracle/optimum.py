"""Settings and results of a search."""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated

import numpy as np

from baselines.oracle.best_known import MARGIN, MEANINGLESS, Record
from ikgym.frozen import Frozen
from ikgym.validation import Bounds, FloatArray, Seed, read_only

#: Names of random starts, and of paths found by iterated local search.
RANDOM, LOCAL_SEARCH = "random start", "local search"
SEARCHED = (RANDOM, LOCAL_SEARCH)
#: Numbers of random starts: all their paths are in memory at the same time.
Starts = Annotated[int, Bounds(at_least=0, at_most=100_000)]


@dataclasses.dataclass(frozen=True)
class Search(Frozen):
    """Effort of a search.

    Args:
        starts: Random starts, on a coarse time grid; at most 100 000.
        chains: Paths that the local search continues with, the best of all starts.
        generations: How often these learn of each other's progress; 0 leaves the local search out.
        rounds: Branches of each path in a generation.
        polished: Paths that are polished at full resolution, besides those that are known there.
        knots: Knots of the coarse grid.
        seed: Of all draws. The same search gives the same path, whatever the number of threads.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    starts: Starts = 400
    chains: Annotated[int, Bounds(at_least=1)] = 8
    generations: Annotated[int, Bounds(at_least=0)] = 4
    rounds: Annotated[int, Bounds(at_least=1)] = 40
    polished: Annotated[int, Bounds(at_least=1)] = 6
    knots: Annotated[int, Bounds(at_least=1)] = 150
    seed: Seed = 0


@dataclasses.dataclass(frozen=True)
class Start:
    """Result of one start.

    Args:
        kind: Where the path came from, in words.
        coarse: Its cost on the coarse grid; None where it was not tried there.
        cost: Its cost in the environment, polished at full resolution; None where it was not worth that.
    """

    kind: str
    coarse: float | None = None
    cost: float | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class Optimum(Frozen):
    """The cheapest joint path of an episode that was found: the best known one, certified by nobody.

    Args:
        scenario: The scenario's name.
        seed: The reset seed.
        q: Joint coordinates after each step, in [rad] or [m]. Shape (steps, n).
        qdot: Joint velocities that lead there, within the velocity limit, in [rad/s] or [m/s]. Shape (steps, n).
        cost: Their cost in the environment.
        gradient_norm: Norm of the cost's gradient there, by q / Δt, in [s/rad] or [s/m].
        starts: All starts.
        seconds: CPU time that one path took at full resolution, in [s].
        hash: Of the episode, see :func:`baselines.fingerprints.episode_hash`.
    """

    scenario: str
    seed: int
    q: FloatArray
    qdot: FloatArray
    cost: float
    gradient_norm: float
    starts: tuple[Start, ...]
    seconds: float
    hash: str

    def __post_init__(self) -> None:
        for name in ("q", "qdot"):
            object.__setattr__(self, name, read_only(getattr(self, name).copy()))

    @property
    def found_by(self) -> str:
        """Kinds of starts that led there, to within a millionth of the cost."""
        return "; ".join(dict.fromkeys(one.kind for one in self.starts if self._is_reached_by(one)))

    @property
    def spread(self) -> dict[str, float]:
        """Statistics of the starts.

        ``starts`` on the coarse grid, how many of them came ``within_1_percent`` of the best there without
        local search, the ``median`` and ``worst`` cost of those that keep the limits; paths ``polished`` at
        full resolution, and how many of them came ``polished_within_1e-6`` of the best; and ``without_search``
        the lowest cost of the starts that need no search.
        """
        coarse = [one.coarse for one in self.starts if one.coarse is not None]
        first = [one.coarse for one in self.starts if one.coarse is not None and one.kind != LOCAL_SEARCH]
        out: dict[str, float] = {
            "polished": sum(one.cost is not None for one in self.starts),
            "polished_within_1e-6": sum(map(self._is_reached_by, self.starts)),
        }
        if known := [one.cost for one in self.starts if one.cost is not None and one.kind not in SEARCHED]:
            out["without_search"] = min(known)
        if within := [cost for cost in first if math.isfinite(cost)]:
            out |= {
                "starts": len(first),
                "within_1_percent": sum(cost <= 1.01 * min(coarse) for cost in first),
                "median": float(np.median(within)),
                "worst": max(within),
            }
        return out

    def record(self) -> Record:
        """As a record of the best known costs."""
        return Record(self.scenario, self.seed, self.cost, self.found_by, self.gradient_norm, self.spread, self.hash)

    def _is_reached_by(self, start: Start) -> bool:
        return start.cost is not None and start.cost <= max(self.cost * (1.0 + MARGIN), MEANINGLESS)
