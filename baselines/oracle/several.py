"""Best known costs of several episodes, one after the other or by workers."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
from collections.abc import Callable, Iterator, Sequence

from baselines import registry
from baselines.episodes import Seeds
from baselines.oracle.best_known import MEANINGLESS
from baselines.oracle.cache import read_cached, solve, write_cached
from baselines.oracle.episode import EpisodeProblem, path_of
from baselines.oracle.optimum import Optimum, Search
from baselines.oracle.stripped import strip_plant
from baselines.policy import SolverPolicy
from baselines.registry import parse_policy
from baselines.workers import ALONE, TOLERANCE, WorkerError, Workers, run_units
from ikgym.scenarios import Scenario


@dataclasses.dataclass(frozen=True, eq=False)
class SearchJob:
    """An episode whose best known cost is wanted.

    Args:
        scenario: The tracking problem.
        draw: Which of its episodes.
        how: Search settings.
        policies: Specs of policies whose paths are starts, too.
        cached: Whether to look on disk first, and to keep the result there.
    """

    scenario: Scenario
    draw: Seeds
    how: Search
    policies: tuple[str, ...] = ()
    cached: bool = True


def find(wanted: SearchJob, tick: Callable[[float], None] = lambda share: None) -> Optimum:
    """The cheapest path that is found, in this process; ``tick`` as of :func:`baselines.oracle.solve`.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: A policy does not suit the scenario, or the scenario cannot be searched.
    """
    scenario, draw = wanted.scenario, wanted.draw
    true = strip_plant(scenario, draw.seed, draw.arm_seed)
    paths = {spec: path_of(_make_policy(true, spec), true, draw.seed) for spec in wanted.policies}
    return solve(scenario, draw.seed, wanted.how, arm_seed=draw.arm_seed, cached=wanted.cached, tick=tick, paths=paths)


def find_all(
    wanted: Sequence[SearchJob],
    workers: Workers = ALONE,
    tick: Callable[[SearchJob, float], None] = lambda one, share: None,
) -> Iterator[tuple[SearchJob, Optimum]]:
    """The cheapest paths that are found; by workers in the order in which they are done.

    Paths found by workers of a cluster are played again here, and kept on the disk of this machine as well. ``tick`` is
    called now and then with an episode and the share of its work done since the last call.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: A policy does not suit a scenario, or a scenario cannot be searched.
        WorkerError: Workers have died over an episode again and again, or found another cost than there is here.
        ClusterError: There is no cluster.
    """
    if workers.here:
        for one in wanted:
            yield one, find(one, functools.partial(tick, one))
        return
    left = []
    for one in wanted:
        on_disk = one.cached and not one.policies
        known = read_cached(one.scenario, one.draw.seed, one.how, one.draw.arm_seed) if on_disk else None
        if known is None:
            left.append(one)
        else:
            yield one, known
    with contextlib.closing(run_units(find, left, workers)) as done:
        for one, future in done:
            try:
                optimum = future.result()
            except WorkerError as e:
                raise WorkerError(f"{one.scenario.name}, seed {one.draw.seed}: {e} Results so far are kept.") from None
            _check(one, optimum)
            if one.cached and not one.policies:
                write_cached(optimum, one.scenario, one.draw.seed, one.how, one.draw.arm_seed)
            tick(one, 1.0)
            yield one, optimum


def check_policies(wanted: Sequence[SearchJob]) -> None:
    """Checks policies on one episode of each scenario, before anything is played.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: A policy does not suit a scenario.
    """
    for one in {one.scenario.name: one for one in wanted}.values():
        for spec in one.policies:
            _make_policy(strip_plant(one.scenario, one.draw.seed, one.draw.arm_seed), spec)


def _make_policy(scenario: Scenario, spec: str) -> SolverPolicy:
    name, parameters = parse_policy(spec)
    return registry.make(name, scenario, **parameters)


def _check(one: SearchJob, optimum: Optimum) -> None:
    """Checks that this machine computes the same cost of a path."""
    episode = EpisodeProblem.of(strip_plant(one.scenario, one.draw.seed, one.draw.arm_seed), one.draw.seed)
    _, cost = episode.play(optimum.qdot)
    if not math.isclose(cost, optimum.cost, rel_tol=TOLERANCE, abs_tol=MEANINGLESS):
        raise WorkerError(
            f"{one.scenario.name}, seed {one.draw.seed}: a worker found {optimum.cost!r}, whose path costs {cost!r} "
            f"here; expected a relative difference of at most {TOLERANCE:g}. Install the same versions on all nodes."
        )
