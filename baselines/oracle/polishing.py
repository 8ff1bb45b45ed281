"""Joint paths at full resolution, made as cheap as Newton's method makes them: the end of every search."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from baselines.fingerprints import episode_hash
from baselines.oracle import local_search
from baselines.oracle.episode import EpisodeProblem
from baselines.oracle.optimum import Optimum, Start
from baselines.solvers.receding_horizon.newton.grid import Grid
from baselines.solvers.receding_horizon.newton.minimise import NewtonSettings
from ikgym.parallel import in_chunks
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

# Newton steps of a path at full resolution, and the relative precision that ends them before.
MOST_STEPS, TOLERANCE = 300, 1e-12


def polish(scenario: Scenario, seed: int, paths: Mapping[str, FloatArray]) -> Optimum:
    """The cheapest joint path of an episode that given paths lead to by Newton's method alone; nothing is searched.

    Args:
        scenario: What is tracked.
        seed: The reset seed.
        paths: Joint coordinates after each step by name. Shapes (steps, n).

    Raises:
        InvalidInputError: See :meth:`EpisodeProblem.of`.
    """
    episode = EpisodeProblem.of(scenario, seed)
    given = [episode.feasible(episode.through(path)) for path in paths.values()]
    return finished(episode, [Start(name) for name in paths], dict(enumerate(given)))


def finished(
    episode: EpisodeProblem,
    starts: Sequence[Start],
    paths: Mapping[int, FloatArray],
    done: Callable[[float], object] = lambda share: None,
) -> Optimum:
    """The best of some paths at full resolution, each of them improved until nothing more is gained.

    Args:
        episode: The episode.
        starts: All starts.
        paths: Paths within the limits, by the numbers of the starts that led to them. Shapes (K, n).
        done: Called now and then with the share of the work done since the last call.
    """
    polished = np.stack(list(paths.values()))
    gains, spent = improved(episode, episode.grid, polished, NewtonSettings(True, MOST_STEPS, TOLERANCE))
    played = [_played(episode, path) for path in polished]
    gradients, reached = gains.gradients * episode.scenario.dt, list(starts)
    for number, (_, _, cost), gradient, steps in zip(paths, played, gradients, gains.steps, strict=True):
        reached[number] = dataclasses.replace(
            reached[number], cost=cost, gradient_norm=float(gradient), newton_steps=int(steps)
        )
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


def improved(
    episode: EpisodeProblem, grid: Grid, paths: FloatArray, settings: NewtonSettings
) -> tuple[local_search.Improved, float]:
    """Improves paths in place, in several threads; gives what became of them, and the CPU time in [s]."""
    out, problem = local_search.Improved(*np.empty((3, len(paths)))), episode.on(grid)
    spent: list[float] = []

    def work(first: int, last: int) -> None:
        begin = time.thread_time()
        local_search.improve(problem, settings, paths, out, first, last)
        spent.append(time.thread_time() - begin)

    in_chunks(work, len(paths), 1)
    return out, sum(spent)


def _played(episode: EpisodeProblem, path: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Joint coordinates and joint velocities of each step, and their cost in the environment."""
    limit = episode.scenario.largest_qdot
    # Multipliers keep limits to rounding; what is left over would add up from step to step.
    qdot = np.clip(episode.commands(episode.feasible(path)), -limit, limit)
    q, cost = episode.play(qdot)
    return q, qdot, cost
