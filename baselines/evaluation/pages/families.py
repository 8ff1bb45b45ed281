"""What is measured for the cost–time page: all policies, the receding horizon by horizon and effort, its presets."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from baselines import registry
from baselines.agents.policy import LearnedPolicy
from baselines.evaluation.pages.entries import Entry, compared, solver
from baselines.solvers.receding_horizon.rhc import RecedingHorizon
from baselines.solvers.wrappers.full_orientation import FullOrientation
from baselines.spec import parse_policy

#: The horizons of the families, and the longest that is computed to the optimum without move blocks: 200 and 400 take
#: three and six times as long as the control period of 1 ms.
HORIZONS, LONGEST = (3, 5, 10, 30, 100, 200, 400), 100
#: Knots for each time that the horizon doubles. On validation episodes half of it loses the arm at 400.
BLOCKS_A_DOUBLING = 3.5
#: Episodes of a preset that are played with the clock, of each seed.
TIMED = 8

OPTIMUM, REAL_TIME = "rhc to the optimum", "rhc, one iteration"
OPTIMUM_BLOCKS, BLOCKS = "rhc to the optimum, move blocks", "rhc, one iteration and move blocks"
#: The ways to compute a receding horizon, from costly to cheap; each is measured at all horizons.
FAMILIES = (OPTIMUM, OPTIMUM_BLOCKS, REAL_TIME, BLOCKS)


def entries(horizons: Iterable[int] = HORIZONS) -> tuple[Entry, ...]:
    """All that are compared; references, which have privileged information, are nobody's choice and left out.

    So are examples for one scenario, solvers of other projects, and what is on the leaderboard: agents, and policies
    that are shown other coordinates than the scenario's; and :data:`FOR_OTHER_ARMS`.

    Args:
        horizons: Those of the families.
    """
    specs = compared(RecedingHorizon, LearnedPolicy, FullOrientation)
    specs += [spec for family in FAMILIES for horizon in horizons if (spec := _spec(family, horizon))]
    looks = [f"{name}:stop_at_end={flag}" for name in presets() for flag in (True, False)]
    return (*(solver(spec, timed=1) for spec in specs), *(solver(spec, timed=TIMED) for spec in looks))


def presets() -> dict[str, type[RecedingHorizon]]:
    """What is derived from `rhc`, by name."""
    classes = {name: registry.get(name) for name in registry.names()}
    return {n: c for n, c in classes.items() if issubclass(c, RecedingHorizon) and c is not RecedingHorizon}


def family(spec: str) -> tuple[str, int] | None:
    """The family of a spec and its horizon; None where it belongs to none."""
    name, parameters = parse_policy(spec)
    horizon = parameters.pop("horizon", None)
    if name != RecedingHorizon.name or horizon is None:
        return None
    kinds: Mapping[frozenset[str], str] = {
        frozenset(): OPTIMUM,
        frozenset({"move_blocks"}): OPTIMUM_BLOCKS,
        frozenset({"iterations"}): REAL_TIME,
        frozenset({"iterations", "move_blocks"}): BLOCKS,
    }
    return (kinds[frozenset(parameters)], horizon) if frozenset(parameters) in kinds else None


def blocks(horizon: int) -> int | None:
    """The knots of a long horizon; None for one that is so short that it needs no move blocks."""
    knots = round(BLOCKS_A_DOUBLING * math.log2(horizon))
    return knots if knots < horizon - 1 else None


def _spec(family: str, horizon: int) -> str | None:
    if family == OPTIMUM and horizon > LONGEST:
        return None
    spec = f"{RecedingHorizon.name}:horizon={horizon}" + (",iterations=1" if family in (REAL_TIME, BLOCKS) else "")
    if family in (OPTIMUM, REAL_TIME):
        return spec
    return None if (knots := blocks(horizon)) is None else f"{spec},move_blocks={knots}"
