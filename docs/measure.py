"""Measures tables of `docs/results`: ``python -m docs.measure pose cost_time periods``.

A table with a module of its name in this folder is what its `measured` returns; a new one begins as an empty CSV file.
Others say by their lines what is played: scenario, policy, episodes and seeds. To add a policy, add a line with these
columns; --new measures those alone. Each policy is timed in two episodes, on one core: times compare within one run on
a machine that does nothing else. A killed measurement continues where it was. Agents that were trained are read from
``runs/NAME/seed-*``, the untrained ones are written there; a line whose scenario or agent is not here stays as it is.
Then ``python -m docs.tables`` and ``python -m docs.pictures`` write the pages.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import inspect
import itertools
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import tyro

import ikgym
from baselines import registry
from baselines.agents.files import AgentFile, save_agent
from baselines.evaluate import evaluate
from baselines.evaluation.metrics import Row
from baselines.evaluation.plots.comparison import front
from baselines.evaluation.rankings import ranking
from baselines.evaluation.summary import LOWEST
from baselines.evaluation.table import records
from baselines.files import canonical, jsonable
from baselines.registry import parse_policy
from docs.keeping import PAGES, RESULTS, RUNS, WORK, Line, keep, lines, resumable

#: Agents as they are before their training, and their training seeds.
UNTRAINED, SEEDS = "untrained", range(5)

#: Policies of `plants` by their labels, around the same base.
RHC = {"policy": "rhc", "options": {"horizon": 60, "iterations": 3, "move_blocks": 8}}
AROUND = {"policy": "predicted", "options": RHC}
ADAPTIVE: dict[str, tuple[str, dict[str, Any]]] = {
    "filter_bank": ("filter_bank", {**AROUND, "start": 1e-5}),
    "calibrated": ("calibrated", {**AROUND, "start": 1e-5}),
    "calibrated, 1 mm": ("calibrated", {**AROUND, "start": 1e-5, "pose_noise": 1e-3, "pose_rotation_noise": 1e-3}),
    "calibrated, 10 µm": ("calibrated", {**AROUND, "start": 1e-5, "pose_noise": 1e-5, "pose_rotation_noise": 1e-5}),
    "offset_free": ("offset_free", AROUND),
}


@dataclasses.dataclass(frozen=True)
class Command:
    """Measures tables of docs/results anew."""

    tables: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Names of CSV files without their end, such as pose, cost_time or compare."""
    new: bool = False
    """Measure only lines that have no cost ratio yet."""
    bench: Path | None = None
    """Folder of the arm with masses that the table `drives` is measured on, see :mod:`docs.drives`."""


def measured(name: str, *, only_new: bool = False) -> list[Line]:
    """The lines of a table, scenario by scenario, from low to high cost ratios."""
    old = lines(name)
    if any(line["policy"].startswith(UNTRAINED) for line in old):
        untrained()
    groups = itertools.groupby(old, lambda line: line["scenario"])
    found = itertools.chain(*(_group(name, list(here), only_new) for _, here in groups))
    return [{column: line.get(column) for column in old[0]} for line in found]


def _group(name: str, old: list[Line], only_new: bool) -> list[Line]:
    """The lines of one scenario; all of them, if one is new and costs are relative to the lowest in the table."""
    todo = [line for line in old if not (only_new and line["cost_ratio"])]
    if todo and any(line.get("relative_to") == LOWEST for line in old):
        todo = old
    scenario = _scenario(old[0])
    todo = [line for line in todo if scenario is not None and policies(line)]
    left = [line for line in old if line not in todo]
    if left and not only_new:
        where = old[0]["scenario"]
        print(f"{name}, {where}: {', '.join(one['policy'] for one in left)}: as before", file=sys.stderr)
    found = list(left)
    for episodes in sorted({int(line["episodes"]) for line in todo}):
        some = [line for line in todo if int(line["episodes"]) == episodes]
        played = [policy for line in some for policy in policies(line)]
        rows = evaluate(scenario, played, episodes=episodes, **resumable(f"{name}-{old[0]['scenario']}-{episodes}"))
        before = {line["policy"]: line for line in some}  # with columns that say which policy this is
        found += [
            before[one["policy"]] | one | _error(scenario, one, rows) for one in records(ranking(rows, list(before)))
        ]
    best = front(found) if "front" in old[0] else []
    found = [{**line, "front": "yes" if line in best else "no"} for line in found]
    return sorted(found, key=lambda line: float(line["cost_ratio"]))


def _scenario(line: Line) -> ikgym.Scenario | None:
    """The scenario of a line, with its control period, if it says one; None where there is no such scenario."""
    name = line["scenario"].partition(" at ")[0]
    if name not in ikgym.scenarios.names():
        return None
    usual = ikgym.scenarios.get(name)
    if "period_ms" not in line:
        return usual
    dt = 1e-3 * float(line["period_ms"])
    return usual.replace(name=line["scenario"], dt=dt, steps=round(usual.steps * usual.dt / dt))


def _error(scenario: ikgym.Scenario | None, one: Line, rows: Sequence[Row]) -> Line:
    """The largest position error of a policy; none of agents and of several seeds."""
    if scenario is None or len(policies(one)) != 1 or not registry.known(one["policy"].partition(":")[0]):
        return {"error_mm": None}
    name, given = parse_policy(one["policy"])
    parameters = canonical(jsonable(registry.make(name, scenario, **given).parameters))
    alike = [row for row in rows if row.policy == name and canonical(row.parameters) == parameters]
    return {"error_mm": 1e3 * max(row.position_error_max for row in alike)}


def policies(line: Line) -> list[str]:
    """The policies whose results make a line: one, or one for each seed; none where an agent is missing."""
    name, seeds = line["policy"], int(line.get("seeds") or 1)
    if not registry.known(name.partition(":")[0]):
        return [f"agent:{file}" for file in sorted((RUNS / name).glob("seed-*/agent.safetensors"))]
    if seeds == 1:
        return [name]
    return [f"{name}{',' if ':' in name else ':'}seed={seed}" for seed in range(seeds)]


def untrained() -> None:
    """Writes agents as they are before their training: of apg, and of PPO and SAC in `ikgym/Track-v0`."""
    import ikgym.sb3
    from baselines.training import rewards, zoo
    from baselines.training.apg import Trainer
    from baselines.training.exporting import agent_of_model
    from baselines.training.options import APG, Rewards

    def by_rewards(algorithm: str, seed: int) -> AgentFile:
        config = Rewards(algorithm=algorithm, env="ikgym/Track-v0")
        settings = zoo.read_settings(config)
        envs = ikgym.sb3.make_vec(config.env, settings["n_envs"])
        return agent_of_model(rewards.make(algorithm, envs, settings, seed), envs)

    def by_gradients(seed: int) -> AgentFile:
        config = APG.preset("standard")
        return Trainer(config, config.make_scenario(), seed).agent()

    makers: dict[str, Callable[[int], AgentFile]] = {
        UNTRAINED: by_gradients,
        f"{UNTRAINED}-ppo": functools.partial(by_rewards, "ppo"),
        f"{UNTRAINED}-sac": functools.partial(by_rewards, "sac"),
    }
    for (name, make), seed in itertools.product(makers.items(), SEEDS):
        file = RUNS / name / f"seed-{seed}" / "agent.safetensors"
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            save_agent(file, make(seed))


def plants(*, only_new: bool = False) -> list[Line]:
    """Costs of adaptive policies on imperfect plants, by the lines of the table; there are no times."""
    return [line if only_new and line["cost_ratio"] else _adaptive(line) for line in lines("plants")]


def _adaptive(line: Line) -> Line:
    rows = evaluate(line["scenario"], [ADAPTIVE[line["policy"]]], episodes=int(line["episodes"]), progress=True)
    [found] = records(ranking(rows))
    return {**line, **{column: found[column] for column in ("cost_ratio", "low", "high", "worst")}}


def table_of(name: str, *, only_new: bool = False, bench: Path | None = None) -> list[Line]:
    """A table: that of the module `docs.NAME` where there is one, else by the lines of its CSV file.

    Raises:
        SystemExit: There is no such table, or it is measured as a whole, and new lines alone were asked for.
    """
    if not (RESULTS / f"{name}.csv").is_file():
        available = ", ".join(sorted(file.stem for file in RESULTS.glob("*.csv")))
        raise SystemExit(f"tables: expected names of tables, got {name!r}; available: {available}.")
    if name == "plants":
        return plants(only_new=only_new)
    if not (PAGES / f"{name}.py").is_file():
        return measured(name, only_new=only_new)
    measure = importlib.import_module(f"docs.{name}").measured
    if "only_new" in inspect.signature(measure).parameters:
        return list(measure(only_new=only_new))
    if only_new:
        raise SystemExit(f"{name}: this table is measured as a whole; leave --new out.")
    return list(measure(bench) if "bench" in inspect.signature(measure).parameters else measure())


def main(command: Command) -> None:
    """Writes the tables."""
    for name in command.tables:
        keep(name, table_of(name, only_new=command.new, bench=command.bench))
        for folder in WORK.glob(f"{name}-*"):  # or the next measurement would have these times
            shutil.rmtree(folder)


if __name__ == "__main__":
    main(tyro.cli(Command))
