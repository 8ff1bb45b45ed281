"""Policies and learners on plants that each episode draws anew, the rows of `results/contexts.csv`.

``python -m docs.measure contexts`` measures them; ``python -m docs.contexts --seeds 0 1 2`` trains the learners first,
into ``runs/context-NAME/seed-N``. A learner that was not trained here keeps its row.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

import ikgym
from baselines.evaluate import evaluate
from baselines.evaluation.metrics import lost
from baselines.files import write_json
from baselines.statistics import geometric_interval, geometric_mean
from baselines.training.options import Rewards
from docs.keeping import RUNS, Line, lines, resumable
from ikgym.rl import IDS, Task, scoring
from ikgym.validation import BoolArray, FloatArray

#: Scenario and seeds of each split, and its episodes.
SPLITS = {
    "train": ("learning-context", "train"),
    "interpolation": ("learning-context", "test"),
    "extrapolation": ("learning-context-beyond", "test"),
}
EPISODES = 128

#: The ranges of the drives, and what is known of the arm before anything is measured: the middle of each range.
DRIVES = {"delay": 1, "bandwidth": 10.0, "longest_delay": 3, "lowest_bandwidth": 4.0, "gain": 0.2}
PRIOR = {"zero": 5e-3, "link": 1e-3, "axis": 2.5e-3, "start": 1e-5}
RHC = {"policy": "rhc", "options": {"horizon": 8, "iterations": 3}}
AROUND = {"policy": "predicted", "options": {**RHC, **DRIVES}}
TOLD, ADAPTIVE = "told", ("filter_bank", "calibrated", "offset_free")
#: Policies by their labels, with settings from validation episodes.
POLICIES: dict[str, tuple[str, dict[str, Any]]] = {
    TOLD: (TOLD, RHC),
    "filter_bank": ("filter_bank", {**AROUND, **PRIOR, "alike": 2e-3}),
    "calibrated": ("calibrated", {**AROUND, **PRIOR, "pose_noise": 1e-3, "pose_rotation_noise": 1e-3, "walk": 1e-3}),
    "offset_free": ("offset_free", {**AROUND, "gain": 0.2}),
    "predicted": ("predicted", {"policy": "dls", "options": {"gain": 0.13}, **DRIVES}),
    "qp": ("qp", {"gain": 0.3}),
    "dls": ("dls", {"gain": 0.15}),
}
#: Learners by their names: published settings, what is observed, and the reward of `ikgym/Limits-v0`.
USUAL = IDS["ikgym/Limits-v0"].task.replace(scenario=SPLITS["train"][0], commands=4, share=0.5)
LEARNERS = {
    "ppo_shown": (Rewards(env="ikgym/Track-v0"), USUAL.replace(context=True)),
    "ppo_history": (Rewards(env="ikgym/Track-v0"), USUAL.replace(history=4)),
    "ppo_recurrent": (Rewards(algorithm="recurrent_ppo", env="ikgym/Camera-v0"), USUAL),
}
#: Costs of episodes, and whether the arm was lost, by split. Shapes (s, e), one row a training seed.
Played = Mapping[str, tuple[FloatArray, BoolArray]]


@dataclasses.dataclass(frozen=True)
class Command:
    """Trains learners where each episode draws its plant."""

    learners: Annotated[tuple[str, ...], tyro.conf.Positional] = tuple(LEARNERS)
    """Names: ppo_shown, ppo_history, ppo_recurrent (of sb3-contrib)."""
    steps: int = 1_000_000
    """Steps of each training, of all arms together."""
    seeds: tuple[int, ...] = (0,)
    """One training each."""


def measure(*, only_new: bool = False) -> list[Line]:
    """The table: costs relative to the policy that knows the plant, and the share of the gap to it that is closed."""
    old = {line["policy"]: line for line in lines("contexts")}
    told, out = _solver(TOLD), []
    for name in POLICIES:
        known = old[name] if only_new and name in old else None
        out.append(known or _line(name, told if name == TOLD else _solver(name), told))
    for name in LEARNERS:
        if files := sorted((RUNS / f"context-{name}").glob("seed-*/model.zip")):
            out.append(_line(name, _learner(name, files), told) | {"minutes": _minutes(files)})
        elif name in old:
            out.append(old[name])
    best = min(float(line["interpolation"]) for line in out if line["policy"] in ADAPTIVE)
    gap = {line["policy"]: 1.0 - np.log(float(line["interpolation"])) / np.log(best) for line in out}
    return [{**line, "gap_closed": float(gap[line["policy"]])} for line in out]


def _line(policy: str, played: Played, told: Played) -> Line:
    """A line of the table, whose last two columns are set when all lines are there."""
    line: Line = {"policy": policy, "seeds": len(played["train"][0]), "episodes": EPISODES, "minutes": None}
    for split, (costs, _) in played.items():
        ratios = costs / told[split][0]
        line[split] = geometric_mean(ratios)
        line[f"{split}_low"], line[f"{split}_high"] = geometric_interval(ratios)
    return line | {"lost_percent": 100.0 * float(np.mean([away for _, away in played.values()])), "gap_closed": None}


def _solver(name: str) -> Played:
    """A policy on the first episodes of each split."""
    out = {}
    for split, (scenario, seeds) in SPLITS.items():
        options = resumable(f"contexts-{split}-{name}")
        rows = evaluate(scenario, [POLICIES[name]], split=seeds, episodes=EPISODES, **options)
        out[split] = np.array([[row.total_cost for row in rows]]), np.array([[row.lost for row in rows]])
    return out


def _learner(name: str, files: Sequence[Path]) -> Played:
    """The models of a learner on the first episodes of each split."""
    from baselines.training.zoo import ALGORITHMS

    learner, task = LEARNERS[name]
    models, out = [ALGORITHMS[learner.algorithm].load(file, device="cpu") for file in files], {}
    for split, (scenario, seeds) in SPLITS.items():
        found = [play(model, task, scenario, ikgym.scenarios.seeds(seeds, EPISODES)) for model in models]
        out[split] = np.array([costs for costs, _ in found]), np.array([away for _, away in found])
    return out


def play(model: Any, task: Task, scenario: str, seeds: Sequence[int]) -> tuple[FloatArray, BoolArray]:
    """Benchmark costs of whole episodes with a model of Stable-Baselines3, and whether arms were lost. Shapes (e,)."""
    costs, worst = np.zeros(len(seeds)), np.zeros((2, 1))
    for infos in scoring.play(model, task.replace(scenario=scenario), seeds):
        costs += infos["tracking_cost"] + infos["velocity_cost"]
        worst = np.maximum(worst, [infos["position_error"], infos["orientation_error"]])
    return costs, np.array([lost(*one) for one in worst.T])


def train(name: str, seed: int, steps: int) -> None:
    """Trains a learner, unless it is there, and writes `model.zip` and `run.json`."""
    import torch

    from baselines.training import rewards, zoo
    from ikgym.sb3 import LearningVecEnv

    folder = RUNS / f"context-{name}" / f"seed-{seed}"
    if (folder / "model.zip").exists():
        return
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    learner, task = LEARNERS[name]
    settings = zoo.read_settings(learner)
    model = rewards.make(learner.algorithm, LearningVecEnv(settings["n_envs"], task), settings, seed)
    begin = time.process_time()
    model.learn(steps)
    minutes = round((time.process_time() - begin) / 60.0, 1)
    model.save(folder / "model.zip")
    write_json(folder / "run.json", {"minutes": minutes, "steps": model.num_timesteps, "settings": settings})
    print(f"{name}, seed {seed}: {model.num_timesteps} steps in {minutes} min", flush=True)


def _minutes(files: Sequence[Path]) -> float:
    """CPU minutes of a training, the mean over its seeds."""
    found = [json.loads(file.with_name("run.json").read_text(encoding="utf-8"))["minutes"] for file in files]
    return float(np.mean(found))


def main(command: Command) -> None:
    """Trains all learners that are asked for."""
    for seed in command.seeds:
        for name in command.learners:
            train(name, seed, command.steps)


if __name__ == "__main__":
    main(tyro.cli(Command))
