"""Agents beside solvers, episode by episode: ``python -m benchmarks.paired --agents runs/apg --beside dls --out FILE``.

Plays all of them on the same episodes, writes what each has cost into FILE, and prints a table: the geometric mean of
the cost of the agents divided by that of a solver, with its interval over training seeds and episodes. Without --agents
the table is that of what is in FILE.
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
import tyro
from tqdm import tqdm

from baselines import registry
from baselines.episodes import rollouts
from baselines.evaluation.metrics import lost
from baselines.evaluation.pages import entries
from baselines.evaluation.pages.claims import Comparison
from baselines.evaluation.pages.markdown import table
from baselines.evaluation.report import number
from baselines.files import json_files, write
from baselines.policy import SolverPolicy
from baselines.spec import parse_policy
from ikgym import scenarios
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

HEAD = ("beside", "cost ratio to it", "median", "agents lost", "it lost")


class Totals(NamedTuple):
    """What a policy has cost.

    Attributes:
        costs: Of each episode.
        lost: Episodes that lost track.
    """

    costs: list[float]
    lost: int


@dataclasses.dataclass(frozen=True)
class Command:
    """Plays agents and solvers on the same episodes."""

    out: pathlib.Path
    """The file, .json."""
    agents: pathlib.Path | None = None
    """Folder of the training seeds; if left out nothing is played."""
    beside: tuple[str, ...] = ("dls",)
    """Solvers, as NAME or NAME:PARAMETER=VALUE,…"""
    scenario: str = "varga7-pose-random"
    """Whose episodes are played."""
    split: Annotated[str, tyro.conf.arg(metavar="NAME")] = "test"
    """Of the seeds of the episodes."""
    episodes: int = 256
    """The first so many."""


def played(command: Command) -> dict[str, Any]:
    """What everybody has cost.

    Raises:
        ResultsError: There is no agent.
        UnknownNameError: There is no such policy, scenario or split.
    """
    assert command.agents is not None
    scenario, seeds = scenarios.get(command.scenario), scenarios.seeds(command.split, command.episodes)
    agents = entries.agent("agents", command.agents).variants
    solvers = {spec: (parse_policy(spec),) for spec in command.beside}
    content: dict[str, Any] = {name: getattr(command, name) for name in ("scenario", "split", "episodes")} | {
        "agents": str(command.agents)
    }
    bar = tqdm(total=len(agents) + len(solvers), unit="policy")
    for label, policies in {"agents": agents, **solvers}.items():
        totals = []
        for name, parameters in policies:
            totals.append(play(scenario, registry.make(name, scenario, **parameters), seeds))
            bar.update()
        content.setdefault("played", {})[label] = {
            "costs": [total.costs for total in totals],
            "lost": [total.lost for total in totals],
        }
    return content


def play(scenario: Scenario, policy: SolverPolicy, seeds: Sequence[int]) -> Totals:
    """Plays a policy alone."""
    episodes = rollouts(scenario, policy, seeds)
    costs = [float(f"{np.sum(e.tracking_cost + e.velocity_cost):.6g}") for e in episodes]
    return Totals(costs, sum(bool(lost(e.position_error.max(), e.orientation_error.max())) for e in episodes))


def ratios(costs: FloatArray, others: FloatArray) -> list[str]:
    """The geometric mean of a cost ratio with its interval, and the median.

    Args:
        costs: A row a training seed, a column an episode. Shape (S, E).
        others: What they are divided by. Shape (S, E), or (1, E).
    """
    return [str(Comparison.of(costs, others)), number(float(np.median(costs / others)))]


def lines(content: dict[str, Any]) -> list[str]:
    """The table."""
    everybody = content["played"]
    own = everybody["agents"]
    return table(HEAD, [_line(label, own, one) for label, one in everybody.items() if one is not own], text=(0, 1))


def _line(label: str, own: dict[str, Any], one: dict[str, Any]) -> list[str]:
    costs, others = np.array(own["costs"]), np.array(one["costs"])
    share = [f"{sum(who['lost'])} of {array.size}" for who, array in ((own, costs), (one, others))]
    return [f"`{label}`", *ratios(costs, others), *share]


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line.

    Args:
        arguments: What stands behind the command; taken from the process if left out.
    """
    command = tyro.cli(Command, description=__doc__, args=arguments)
    if command.agents is not None:
        write(command.out, (json.dumps(played(command)) + "\n").encode())
    print("\n".join(lines(json_files.read(command.out))))


if __name__ == "__main__":
    main()
