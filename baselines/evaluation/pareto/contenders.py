"""Who is compared: all policies as they are, the receding horizon by horizon and effort, and its presets."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import Any

from baselines import registry
from baselines.agents.policy import LearnedPolicy
from baselines.solvers.receding_horizon.rhc import RecedingHorizon
from baselines.solvers.wrappers.full_orientation import FullOrientation
from baselines.spec import parse_policy

#: The horizons of the families.
HORIZONS = (3, 5, 10, 30, 100, 200, 400)
#: Knots for each time that the horizon doubles. On validation episodes half of it loses the arm at 400.
BLOCKS_A_DOUBLING = 3.5
#: Seeds of a preset that draws at random.
SEEDS = (0, 1, 2)

OPTIMUM, REAL_TIME = "rhc to the optimum", "rhc, one iteration"
OPTIMUM_BLOCKS, BLOCKS = "rhc to the optimum, blocks", "rhc, one iteration and blocks"
#: The ways to compute a receding horizon, from dear to cheap; each is measured at all horizons.
FAMILIES = (OPTIMUM, OPTIMUM_BLOCKS, REAL_TIME, BLOCKS)


@dataclasses.dataclass(frozen=True)
class Contender:
    """A policy that is measured.

    Args:
        spec: Its name and parameters as text, see :data:`baselines.spec.PolicySpec`.
        seeds: Seeds of the policy itself, whose episodes are put together; none where it draws nothing at random.
        timed: Episodes of each seed that are played with the clock.
    """

    spec: str
    seeds: tuple[int, ...] = ()
    timed: int = 1

    @property
    def variants(self) -> list[tuple[str, dict[str, Any]]]:
        """Name and parameters, for each seed."""
        name, parameters = parse_policy(self.spec)
        return [(name, {**parameters, "seed": seed}) for seed in self.seeds] or [(name, parameters)]


def contenders(
    horizons: Iterable[int] = HORIZONS, *, seeds: tuple[int, ...] = SEEDS, timed: int = 8
) -> tuple[Contender, ...]:
    """All that are compared: references, which know what no observation shows, are nobody's choice and left out.

    So are agents, and policies that are shown other coordinates than the scenario's: they are on the leaderboard.

    Args:
        horizons: Those of the families.
        seeds: Seeds of presets that draw at random.
        timed: Timed episodes of a preset, of each seed.
    """
    classes = {name: registry.get(name) for name in registry.names()}
    elsewhere = (RecedingHorizon, LearnedPolicy, FullOrientation)
    plain = [Contender(n) for n, c in classes.items() if not (c.reference or issubclass(c, elsewhere))]
    families = [Contender(spec) for family in FAMILIES for h in horizons if (spec := _spec(family, h))]
    tuned = [
        Contender(f"{name}:stop_at_end={knows}", seeds if _draws(preset) else (), timed)
        for name, preset in presets().items()
        for knows in (True, False)
    ]
    return (*plain, *families, *tuned)


def presets() -> dict[str, type[RecedingHorizon]]:
    """What is derived from `rhc`, by name."""
    classes = {name: registry.get(name) for name in registry.names()}
    return {n: c for n, c in classes.items() if issubclass(c, RecedingHorizon) and c is not RecedingHorizon}


def family(spec: str) -> tuple[str, int] | None:
    """The family of a contender and its horizon; None where it belongs to none."""
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
    """The knots of a long horizon; None for one that is so short that it needs no blocks."""
    knots = round(BLOCKS_A_DOUBLING * math.log2(horizon))
    return knots if knots < horizon - 1 else None


def _spec(family: str, horizon: int) -> str | None:
    spec = f"{RecedingHorizon.name}:horizon={horizon}" + (",iterations=1" if family in (REAL_TIME, BLOCKS) else "")
    if family in (OPTIMUM, REAL_TIME):
        return spec
    return None if (knots := blocks(horizon)) is None else f"{spec},move_blocks={knots}"


def _draws(policy: type[RecedingHorizon]) -> bool:
    return policy.starts > 1 or policy.restart_steps > 0
