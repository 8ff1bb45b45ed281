"""Measures tables of `docs/results` anew: ``python -m docs.measure pose cost_time periods agents_interval``.

A table says by its lines what is played: scenario, policy, episodes and seeds. To add a policy, add a line with these
columns; --new measures those alone, without times, and --times the times alone. Each policy is timed in two episodes,
on one core of a machine that does nothing else. A killed measurement continues where it was. Agents that were trained
are read from ``runs/NAME/seed-*``, the untrained ones are written there; a line whose scenario or agent is not here
stays as it is. Then ``python -m docs.tables`` and ``python -m docs.pictures`` write the page.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import tyro

import baselines
import ikgym
from baselines import registry
from baselines.agents.files import AgentFile, save_agent
from baselines.episodes import rollouts
from baselines.evaluate import evaluate
from baselines.evaluation.plots.comparison import front
from baselines.evaluation.records import from_csv, records, to_csv
from baselines.files import write
from baselines.oracle import best_known
from baselines.statistics import geometric_interval, geometric_mean
from docs import contexts

RESULTS = Path(__file__).parent / "results"
#: What was measured lies here until the end, and agents are found here.
WORK, RUNS = Path("results") / "measure", Path("runs")
#: Agents as they are before their training, and their training seeds.
UNTRAINED, SEEDS = "untrained", range(5)
#: The intervals of `agents_interval`, its agent, scenario and episodes.
INTERVALS, AGENT, SCENARIO, EPISODES = (1, 2, 4, 8, 16, 32, 64), "agent_alone", "varga7-pose-random", 256

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

#: Columns of `bodies`.
COSTS = ("scenario", "policy", "episodes", "relative_to", "cost_ratio", "low", "high")
BODIES = (*COSTS, "error_mm", "stopped_percent", "clearance_mm", "time_p50_us")

#: Steps over which times in batches are taken: a multiple of all intervals.
BATCHED = 256

#: Columns of a table that depend on the machine, and the episodes in which they are measured.
TIMES, TIMED = ("time_p50_us", "time_p99_us"), 2
Line = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Command:
    """Measures tables of docs/results anew."""

    tables: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Names of CSV files without their end: pose, cost_time, periods, free_timing, skew, agents_interval, agents_panda,
    plants, bodies and contexts."""
    new: bool = False
    """Measure only lines that have no cost ratio yet, and no times."""
    times: bool = False
    """Measure only the times; costs stay."""


def measured(name: str, *, only_new: bool = False, only_times: bool = False) -> list[Line]:
    """The lines of a table, scenario by scenario, from low to high cost ratios."""
    old = list(map(dict, from_csv((RESULTS / f"{name}.csv").read_text(encoding="utf-8"))))
    new: list[Line] = []
    for scenario, here in itertools.groupby(old, lambda line: line["scenario"]):
        lines = list(here)
        todo = [line for line in lines if not (only_new and line["cost_ratio"])]
        todo = [line for line in todo if scenario in ikgym.scenarios.names() and policies(line)]
        left = [line for line in lines if line not in todo]
        if left and not only_new:
            print(f"{name}, {scenario}: {', '.join(one['policy'] for one in left)}: as before", file=sys.stderr)
        if only_times:
            timed = {one["policy"]: one for one in (_played(name, scenario, todo, TIMED) if todo else [])}
            found = [line | {column: timed[line["policy"]][column] for column in TIMES} for line in todo]
        else:
            parts = _by_episodes(todo)
            found = list(itertools.chain(*(_played(name, scenario, some, int(some[0]["episodes"])) for some in parts)))
        if only_new:
            found = [one | dict.fromkeys(TIMES) for one in found]
        found = sorted([*found, *left], key=lambda one: float(one["cost_ratio"]))
        if "front" in lines[0]:
            best = front(found)
            found = [{**one, "front": "yes" if one in best else "no"} for one in found]
        new += found
    columns = dict.fromkeys(itertools.chain(*new))
    return [{column: line.get(column) for column in columns} for line in new]


def policies(line: Line) -> list[str]:
    """The policies whose results make a line: one, or one for each seed; none where an agent is missing."""
    name, seeds = line["policy"], int(line["seeds"] or 1)
    if not registry.known(name.partition(":")[0]):
        return [f"agent:{file}" for file in sorted((RUNS / name).glob("seed-*/agent.safetensors"))]
    if seeds == 1:
        return [name]
    return [f"{name}{',' if ':' in name else ':'}seed={seed}" for seed in range(seeds)]


def _by_episodes(lines: Sequence[Line]) -> Iterable[list[Line]]:
    """Lines with the same number of episodes."""
    for number in sorted({int(line["episodes"]) for line in lines}):
        yield [line for line in lines if int(line["episodes"]) == number]


def _played(name: str, scenario: str, lines: Sequence[Line], episodes: int) -> list[Line]:
    """Lines with the same scenario, measured."""
    played = [policy for line in lines for policy in policies(line)]
    rows = evaluate(scenario, played, episodes=episodes, **kept(f"{name}-{scenario}-{episodes}"))
    return records(rows, [line["policy"] for line in lines])


def kept(name: str) -> dict[str, Any]:
    """Options of an evaluation that continues where it was."""
    return {"timed": TIMED, "out": WORK / name, "resume": True, "report": False, "progress": True}


def untrained() -> None:
    """Writes agents as they are before their training: of apg, and of PPO and SAC in `ikgym/Track-v0`."""
    from baselines.training import rewards
    from baselines.training.exporting import exported
    from baselines.training.methods import BY_REWARDS, configure
    from baselines.training.trainer import Trainer

    def by_rewards(method: str, seed: int) -> AgentFile:
        config = BY_REWARDS[method](env="ikgym/Track-v0")
        model: Any = rewards.make(config, rewards.read(config), seed)
        return exported(model, model.get_env())

    def by_gradients(seed: int) -> AgentFile:
        config = configure("standard")
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


def intervals(*, only_new: bool = False, only_times: bool = False) -> list[Line]:
    """Cost and times of an agent over the steps from one evaluation of its network to the next."""
    scenario, seeds = ikgym.scenarios.get(SCENARIO), ikgym.scenarios.seeds("test", EPISODES)
    old = from_csv((RESULTS / "agents_interval.csv").read_text(encoding="utf-8")) if only_times else []
    known, first, out = np.array(best_known.costs(scenario, seeds), dtype=np.float64), None, []
    for number, interval in enumerate(INTERVALS):
        policy: Any = baselines.make(AGENT, scenario, interval=interval)
        line: Line = {"interval": interval}
        if only_times:
            line = dict(old[number])
        else:
            played = rollouts(scenario, policy, seeds)
            total = np.array([one.cost.sum() for one in played])
            first = total if first is None else first
            for name, ratios in {"cost_ratio": total / known, "times_every_step": total / first}.items():
                prefix = "" if name == "cost_ratio" else f"{name}_"
                low, high = geometric_interval(ratios)
                line |= {name: geometric_mean(ratios), f"{prefix}low": low, f"{prefix}high": high}
        timed = [one.time_ns[1:] for one in rollouts(scenario, policy, seeds[:TIMED], timed=True)]
        micros = np.concatenate(timed) / 1e3
        times = {"time_mean_us": micros.mean(), "time_p99_us": np.percentile(micros, 99), "time_max_us": micros.max()}
        times["time_batch_us"] = _batch_time(scenario, policy, seeds)
        out.append(line | {key: None if only_new else float(value) for key, value in times.items()})
    return out


def periods() -> list[Line]:
    """Cost and times of policies on the same motions at longer control periods."""
    old, usual, out = from_csv((RESULTS / "periods.csv").read_text(encoding="utf-8")), ikgym.scenarios.get(SCENARIO), []
    for period, some in itertools.groupby(old, lambda line: line["period_ms"]):
        lines, dt = list(some), 1e-3 * float(period)
        name = f"{SCENARIO} at {period} ms"
        scenario = usual.replace(name=name, dt=dt, steps=round(usual.steps * usual.dt / dt))
        played, episodes = [line["policy"] for line in lines], int(lines[0]["episodes"])
        rows = evaluate(scenario, played, episodes=episodes, timed=TIMED, progress=True)
        found = [{"period_ms": period, **record} for record in records(rows, played)]
        best = front(found)
        out += [record | {"front": "yes" if record in best else "no"} for record in found]
    return out


def bodies() -> list[Line]:
    """Costs, stops and clearances in scenarios with bodies."""
    old, out = from_csv((RESULTS / "bodies.csv").read_text(encoding="utf-8")), []
    for scenario, some in itertools.groupby(old, lambda line: line["scenario"]):
        lines = list(some)
        played, episodes = [line["policy"] for line in lines], int(lines[0]["episodes"])
        rows = evaluate(scenario, played, episodes=episodes, **kept(f"bodies-{scenario}"))
        errors = {name: max(row.position_error_max for row in rows if row.policy == name) for name in played}
        found = [{**record, "error_mm": 1e3 * errors[record["policy"]]} for record in records(rows, played)]
        out += [{column: record[column] for column in BODIES} for record in found]
    return out


def plants(*, only_new: bool = False, only_times: bool = False) -> list[Line]:
    """Costs of adaptive policies on imperfect plants, by the lines of the table; there are no times."""
    old = from_csv((RESULTS / "plants.csv").read_text(encoding="utf-8"))
    return [dict(line) if only_times or (only_new and line["cost_ratio"]) else _adaptive(line) for line in old]


def _adaptive(line: Line) -> Line:
    rows = evaluate(line["scenario"], [ADAPTIVE[line["policy"]]], episodes=int(line["episodes"]), progress=True)
    [found] = records(rows)
    return {**line, **{column: found[column] for column in ("cost_ratio", "low", "high", "worst")}}


def _batch_time(scenario: ikgym.Scenario, policy: Any, seeds: Sequence[int]) -> float:
    """The mean time of an arm in [µs] where `predict` is called for all episodes at once."""
    envs: Any = gym.make_vec("RedundantIK-v0", num_envs=len(seeds), scenario=scenario, preview=policy.preview)
    observation, _ = envs.reset(seed=list(seeds))
    state, spent = None, 0.0
    for step in range(-BATCHED, BATCHED):  # the first half is not counted
        begin = time.perf_counter()
        action, state = policy.predict(observation, state)
        spent += (time.perf_counter() - begin) * (step >= 0)
        observation, *_ = envs.step(action)
    envs.close()
    return 1e6 * spent / (BATCHED * len(seeds))


#: Tables that are measured as a whole, and others with columns of their own.
WHOLE = {"bodies": bodies, "periods": periods}
OWN = {"agents_interval": intervals, "contexts": contexts.measured, "plants": plants}


def main(command: Command) -> None:
    """Writes the tables."""
    untrained()
    for name in command.tables:
        if name in WHOLE and (command.new or command.times):
            raise SystemExit(f"{name}: costs are relative to the lowest in the table, which is measured as a whole.")
        make = OWN.get(name, functools.partial(measured, name))
        new = WHOLE[name]() if name in WHOLE else make(only_new=command.new, only_times=command.times)
        write(RESULTS / f"{name}.csv", to_csv(new).encode())
        for folder in WORK.glob(f"{name}-*"):  # or the next measurement would have these times
            shutil.rmtree(folder)


if __name__ == "__main__":
    main(tyro.cli(Command))
