"""The search for the cheapest joint path of a whole episode: many starts, local search, Newton's method at the end."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from baselines.fingerprints import episode_hash
from baselines.oracle import local_search
from baselines.oracle.episode import EpisodeProblem, path_of
from baselines.oracle.optimum import LOCAL_SEARCH, RANDOM, Optimum, Search, Start
from baselines.solvers.receding_horizon.newton.grid import Grid
from baselines.solvers.receding_horizon.newton.minimise import NewtonSettings
from baselines.solvers.receding_horizon.rhc import RecedingHorizon
from ikgym.kernels.threads import in_chunks
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Raise it with any change of the search's results or of the fields of an optimum: older files count no more.
VERSION = 3
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
# Newton steps of a path at full resolution, and the relative precision that ends them before.
MOST_STEPS, TOLERANCE = 300, 1e-12
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

    The arguments are those of :func:`baselines.oracle.solve`; ``tick`` and ``paths`` likewise.

    Raises:
        InvalidInputError: The seed is no whole number of at least 0, or the scenario's plant is not ideal.
    """
    episode = EpisodeProblem.of(scenario, seed)
    done = tick or (lambda share: None)
    known = _known_paths(episode, bool(paths))
    known |= {name: episode.through(q) for name, q in (paths or {}).items()}
    # Newton's method keeps the cheaper of a path and its improvement: no path may be cheap by passing a limit.
    known = {name: episode.feasible(path) for name, path in known.items()}
    starts, fine = [Start(kind) for kind in known], dict(enumerate(known.values()))
    done(0.1)
    # Where no velocity costs, as with held points, each knot is a separate problem: nothing to search for.
    if episode.grid.velocity.any():
        starts, found = _coarse_search(episode, how, known, done)
        fine |= found
    return polish_best(episode, starts, fine, done)


def _known_paths(episode: EpisodeProblem, others: bool) -> dict[str, FloatArray]:
    """Paths at full resolution that need no search; ``others`` is whether there are paths of policies besides."""
    scenario, seed, grid = episode.scenario, episode.seed, episode.grid
    out = {}
    nominal = scenario.nominal_joint_path(seed)
    if nominal is not None:
        out["nominal joint path"] = np.ascontiguousarray(nominal[grid.at])
    if others and episode.clearance is not None:
        return out  # among bodies each path takes seconds, and a roll-out touches them
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
    """Starts and local search on a coarse grid: all starts, the known ones first, and the best others refined."""
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
    (costs, _), _ = improve(episode, grid, paths, NewtonSettings(False, local_search.STEPS, local_search.PRECISION))
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
    starts = [Start(kind, cost) for kind, cost in zip(kinds, costs.tolist(), strict=True)]
    best = [number for number in _distinct(costs, how.polished) if number >= len(known)]
    return starts, {number: episode.refine(grid, paths[number]) for number in best}


def _distinct(costs: FloatArray, most: int) -> list[int]:
    """The cheapest, one of each cost, from the best up."""
    chosen: list[int] = []
    for i in np.argsort(costs, kind="stable").tolist():
        if not chosen or costs[i] > (1.0 + APART) * costs[chosen[-1]]:
            chosen.append(i)
        if len(chosen) == most:
            break
    return chosen


def polish(scenario: Scenario, seed: int, paths: Mapping[str, FloatArray]) -> Optimum:
    """The cheapest joint path of an episode that given paths lead to by Newton's method alone; nothing is searched.

    The paths are joint coordinates after each step by name, of shape (steps, n).

    Raises:
        InvalidInputError: See :meth:`EpisodeProblem.of`.
    """
    episode = EpisodeProblem.of(scenario, seed)
    given = [episode.feasible(episode.through(path)) for path in paths.values()]
    return polish_best(episode, [Start(name) for name in paths], dict(enumerate(given)))


def polish_best(
    episode: EpisodeProblem,
    starts: Sequence[Start],
    paths: Mapping[int, FloatArray],
    done: Callable[[float], object] = lambda share: None,
) -> Optimum:
    """The best of some paths at full resolution, each of them improved until nothing more is gained.

    The paths (K, n) lie within the limits, and have the numbers of the starts that led to them.
    """
    polished = np.stack(list(paths.values()))
    gains, spent = improve(episode, episode.grid, polished, NewtonSettings(True, MOST_STEPS, TOLERANCE))
    played = [_play(episode, path) for path in polished]
    gradients, reached = gains.gradients * episode.scenario.dt, list(starts)
    for number, (_, _, cost) in zip(paths, played, strict=True):
        reached[number] = dataclasses.replace(reached[number], cost=cost)
    best = int(np.argmin([cost for _, _, cost in played]))
    q, qdot, cost = played[best]
    done(0.1)
    return Optimum(
        scenario=episode.scenario.name,
        seed=episode.seed,
        q=q,
        qdot=qdot,
        cost=cost,
        gradient_norm=float(gradients[best]),
        starts=tuple(reached),
        seconds=spent / len(paths),
        hash=episode_hash(episode.scenario, episode.seed),
    )


def improve(
    episode: EpisodeProblem, grid: Grid, paths: FloatArray, settings: NewtonSettings
) -> tuple[local_search.Improved, float]:
    """Improves paths in place, in several threads; gives the improved ones, and the CPU time in [s]."""
    out, problem = local_search.Improved(*np.empty((2, len(paths)))), episode.on(grid)
    spent: list[float] = []

    def work(first: int, last: int) -> None:
        begin = time.thread_time()
        local_search.improve(problem, settings, paths, out, first, last)
        spent.append(time.thread_time() - begin)

    in_chunks(work, len(paths), 1)
    return out, sum(spent)


def _play(episode: EpisodeProblem, path: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Joint coordinates and joint velocities of each step, and their cost in the environment."""
    limit = episode.scenario.largest_qdot
    # Multipliers keep limits to rounding; the remainders would add up from step to step.
    qdot = np.clip(episode.commands(episode.feasible(path)), -limit, limit)
    q, cost = episode.play(qdot)
    return q, qdot, cost
