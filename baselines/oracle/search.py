"""The search for the cheapest joint path of a whole episode, from many starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from baselines.oracle import local_search
from baselines.oracle.episode import EpisodeProblem, path_of
from baselines.oracle.optimum import LOCAL_SEARCH, RANDOM, Optimum, Search, Start
from baselines.oracle.polishing import finished, improved
from baselines.solvers.receding_horizon.newton.minimise import NewtonSettings
from baselines.solvers.receding_horizon.rhc import RecedingHorizon
from ikgym.parallel import in_chunks
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Raised by whoever changes what the search finds: what was kept on disk before counts no more.
VERSION = 2
#: Receding horizons whose paths are starts, too.
HORIZONS: tuple[Mapping[str, Any], ...] = (
    {"horizon": 1001, "move_blocks": 48, "iterations": 1, "starts": 64, "restart_steps": 10, "stop_at_end": True},
    {"horizon": 101, "move_blocks": 24, "iterations": 1, "starts": 64, "restart_steps": 10, "stop_at_end": True},
)
# Costs closer than this share belong to the same path.
APART = 1e-3
# Random starts worth a thread.
GRAIN = 4
# Paths that others are blended with.
PARTNERS = 32
# Seeds of the generations of the local search lie this far apart.
STRIDE = 1_000_003


def search(
    scenario: Scenario,
    seed: int,
    how: Search,
    tick: Callable[[float], object] | None = None,
    paths: Mapping[str, FloatArray] | None = None,
) -> Optimum:
    """The cheapest joint path of an episode that the starts lead to.

    Args:
        scenario: What is tracked.
        seed: The reset seed.
        how: How thoroughly.
        tick: Called now and then with the share of the work done since the last call.
        paths: Joint coordinates after each step by name, further starts. Shapes (steps, n).

    Raises:
        InvalidInputError: The seed is no whole number of at least 0, or the scenario's plant is not ideal.
    """
    episode = EpisodeProblem.of(scenario, seed)
    done = tick or (lambda share: None)
    known = _known_paths(episode)
    known |= {name: episode.through(q) for name, q in (paths or {}).items()}
    # Newton's method keeps the cheaper of a path and what it makes of it: no path may be cheap by passing a limit.
    known = {name: episode.feasible(path) for name, path in known.items()}
    starts, fine = [Start(kind) for kind in known], dict(enumerate(known.values()))
    done(0.1)
    # Where no velocity costs, as with held points, each knot is a problem of its own: nothing to search for.
    if episode.grid.velocity.any():
        starts, found = _coarse_search(episode, how, known, done)
        fine |= found
    return finished(episode, starts, fine, done)


def _known_paths(episode: EpisodeProblem) -> dict[str, FloatArray]:
    """Paths at full resolution that need no search."""
    scenario, seed, grid = episode.scenario, episode.seed, episode.grid
    out = {}
    nominal = scenario.nominal_joint_path(seed)
    if nominal is not None:
        out["nominal joint path"] = np.ascontiguousarray(nominal[grid.at])
    rolled = np.empty((1, episode.knots, scenario.joints))
    local_search.random_paths(episode.on(grid), 0, rolled, 0, 1)
    out["roll-out"] = rolled[0]
    if episode.knots == scenario.steps:
        for given in HORIZONS:
            horizon = max(min(int(given["horizon"]), scenario.steps + 1), 2)
            fitting = {**given, "horizon": horizon, "move_blocks": min(int(given["move_blocks"]), horizon - 1)}
            policy = RecedingHorizon.for_scenario(scenario, **fitting)
            out.setdefault(f"rhc, horizon {given['horizon']}", path_of(policy, scenario, seed))
    return out


def _coarse_search(
    episode: EpisodeProblem, how: Search, known: Mapping[str, FloatArray], done: Callable[[float], object]
) -> tuple[list[Start], dict[int, FloatArray]]:
    """Starts and local search on a coarse grid.

    Returns:
        All starts, the known ones first; and by their numbers the best of the others at full resolution.
    """
    grid = episode.coarse(max(-(-episode.knots // how.knots), 1))
    ends = np.searchsorted(episode.grid.at, grid.at)
    paths = np.empty((len(known) + how.starts, len(grid.at), episode.scenario.joints))
    for path, fine in zip(paths, known.values(), strict=False):
        path[:] = fine[ends]
    problem = episode.on(grid)
    # Start 0 of the kernel does not drift, and is known already.
    drawn = paths[len(known) - 1 :]
    in_chunks(
        lambda first, last: local_search.random_paths(problem, how.seed, drawn, first + 1, last + 1), how.starts, GRAIN
    )
    (costs, _, _), _ = improved(episode, grid, paths, NewtonSettings(False, local_search.STEPS, local_search.PRECISION))
    done(0.3)

    chosen = _distinct(costs, PARTNERS)
    partners, chains = paths[chosen], paths[chosen[: how.chains]]
    reached = costs[chosen[: how.chains]]
    for generation in range(1, how.generations + 1):
        seed, pool = how.seed + generation * STRIDE, np.concatenate([chains, partners])

        def work(first: int, last: int, seed: int = seed, pool: FloatArray = pool) -> None:
            local_search.iterated_local_search(problem, seed, how.rounds, pool, chains, reached, first, last)

        in_chunks(work, len(chains), 1)
        done(0.5 / how.generations)
    better = reached < costs[chosen[: how.chains]]
    paths, costs = np.concatenate([paths, chains[better]]), np.concatenate([costs, reached[better]])

    kinds = [*known, *[RANDOM] * how.starts, *[LOCAL_SEARCH] * int(better.sum())]
    starts = [
        Start(kind, number - len(known) + 1 if kind == RANDOM else None, cost)
        for number, (kind, cost) in enumerate(zip(kinds, costs.tolist(), strict=True))
    ]
    best = [number for number in _distinct(costs, how.polished) if number >= len(known)]
    return starts, {number: episode.refined(grid, paths[number]) for number in best}


def _distinct(costs: FloatArray, most: int) -> list[int]:
    """The cheapest, one of each cost, from the best up."""
    chosen: list[int] = []
    for i in np.argsort(costs, kind="stable").tolist():
        if not chosen or costs[i] > (1.0 + APART) * costs[chosen[-1]]:
            chosen.append(i)
        if len(chosen) == most:
            break
    return chosen
