"""Scores of learners in the environments by id: ``python -m benchmarks.learning --algorithms ppo``.

Trains each algorithm in each environment with each seed, a process a core, and plays the last model on episodes of the
split `test`. ``docs/results/learning_runs.csv`` keeps the curves; a run that stands there with the same settings is not
repeated, so the command may be killed and continued.
``docs/results/learning.csv`` has a line for each algorithm and environment, ``docs/images/learning.png`` the curves.
"""

from __future__ import annotations

import concurrent.futures
import csv
import dataclasses
import hashlib
import itertools
import json
import multiprocessing
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import tyro
from matplotlib.figure import Figure

from baselines.evaluation.plots import style
from baselines.evaluation.table import from_csv, to_csv
from baselines.files import write
from baselines.training.options import Rewards
from baselines.training.rewards import train
from baselines.training.zoo import ALGORITHMS, SETTINGS, read_entries, read_settings
from benchmarks.regression import imitate
from ikgym import rl
from ikgym.rl.scoring import EPISODES

DOCS = Path(__file__).parents[1] / "docs"
CURVES, TABLE, PICTURE = DOCS / "results/learning_runs.csv", DOCS / "results/learning.csv", DOCS / "images/learning.png"
#: What one training is known by, and what a line of the table is about.
RUN, GROUP = ("environment", "algorithm", "settings", "digest", "seed"), ("environment", "algorithm", "settings")
#: CPU time of a run with the defaults of the library, which know no number of steps, in [min].
MINUTES = 4.0
Line = dict[str, Any]
Kind = Literal["published", "inverse", "defaults", "regression"]


class Training(NamedTuple):
    """One run: its options, seed and folder."""

    config: Rewards
    seed: int
    folder: Path
    imitates: bool = False


@dataclasses.dataclass(frozen=True)
class Command:
    """Trains, and writes curves and scores."""

    algorithms: tuple[str, ...] = tuple(ALGORITHMS)
    """Of Stable-Baselines3 and sb3-contrib."""
    environments: tuple[str, ...] | None = None
    """Their ids; those that the published settings of the algorithm are for if left out."""
    seeds: tuple[int, ...] = (0, 1, 2, 3, 4)
    """Of the trainings."""
    kind: Kind = "published"
    """Settings: the published ones, the published ones where learners also see joint velocities of the model's damped
    inverse, the defaults of the library; or regression on the policy with score 1, with the published ones of SAC."""
    workers: int = 2
    """Processes that train at the same time."""
    runs: Path = Path("runs")
    """Folder of the models."""

    def trainings(self) -> list[Training]:
        """All of them, the first seeds first."""
        imitates, out = self.kind == "regression", []
        defaults, inverse = self.kind == "defaults", self.kind == "inverse"
        algorithms = ("sac",) if imitates else self.algorithms
        pairs = list(itertools.product(self.environments or rl.IDS, algorithms))
        if self.environments is None:
            pairs = [(env, name) for env, name in pairs if env in read_entries(SETTINGS / f"{name}.yml")]
        for seed, (env, algorithm) in itertools.product(self.seeds, pairs):
            minutes = MINUTES if defaults else None
            config = Rewards(algorithm=algorithm, env=env, minutes=minutes, defaults=defaults, inverse=inverse)
            folder = self.runs / "-".join((env.split("/")[1], algorithm, self.kind)) / f"seed-{seed}"
            out.append(Training(config, seed, folder, imitates))
        return out


def about(training: Training) -> Line:
    """What a training is known by."""
    config = training.config
    digest = hashlib.sha256(json.dumps(read_settings(config), sort_keys=True).encode()).hexdigest()[:8]
    kind = "defaults" if config.defaults else "inverse" if config.inverse else "published"
    algorithm = "regression" if training.imitates else config.algorithm
    return dict(zip(RUN, (config.env, algorithm, kind, digest, str(training.seed)), strict=True))


def curve(training: Training) -> list[Line]:
    """Trains, and gives the lines of the curve; the last one has the test."""
    config, known = training.config, about(training)
    if training.imitates:
        settings, since = read_settings(config), time.process_time()
        model: Any = imitate(config.env, settings, training.seed)
        spent, score = (
            time.process_time() - since,
            rl.score({config.env: [rl.costs(model, config.env)]})[config.env].mean,
        )
        rows = [{"core_seconds": f"{spent:.1f}", "steps": str(settings["n_timesteps"]), "score": f"{score:.4f}"}]
    else:
        train(config, training.seed, training.folder)
        with (training.folder / "curve.csv").open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        model = ALGORITHMS[config.algorithm].load(training.folder / "model.zip", device="cpu")
    lines: list[Line] = [{**known, **row, "test_log_cost": None} for row in rows]
    cost = rl.costs(model, config.env, split="test", episodes=EPISODES, inverse=config.inverse)
    lines[-1]["test_log_cost"] = f"{np.log1p(cost).mean():.4f}"
    return lines


def table(lines: Sequence[Line], seeds: int = 5) -> list[Line]:
    """Interquartile means over the seeds, a line for each algorithm and environment that has as many."""
    out = []
    for group, found in _groups(lines).items():
        last = [line for line in found if line["test_log_cost"]]
        if len(last) < seeds:
            continue
        cost = np.expm1([[float(line["test_log_cost"])] * EPISODES for line in last])
        score = rl.score({group[0]: cost}, "test")[group[0]]
        steps, seconds = (float(np.median([float(one[name]) for one in last])) for name in ("steps", "core_seconds"))
        effort = {"steps": int(steps), "core_minutes": round(seconds / 60.0, 1)}
        scores = {"score": score.mean, "low": score.low, "high": score.high, "best": score.best}
        line = dict(zip(GROUP, group, strict=True)) | {"seeds": len(last), "episodes": EPISODES, **effort}
        out.append({**line, **{name: round(value, 3) for name, value in scores.items()}})
    return out


def picture(lines: Sequence[Line]) -> Figure:
    """Validation scores over core-minutes, a panel for each environment, a line for each seed."""
    here = [env for env in rl.IDS if any(line["environment"] == env for line in lines)]
    columns = 2 if len(here) == 4 else min(3, len(here))
    high = -(-len(here) // columns)
    drawn = style.figure(3.0 * high)
    every = drawn.subplots(high, columns, sharey=True, squeeze=False).ravel()
    panels = dict(zip(here, every, strict=False))
    for axes in every[len(here) :]:
        axes.remove()
    handles: Line = {}
    for (env, algorithm, kind), found in sorted(_groups(lines).items()):
        if algorithm == "regression":  # has no curve
            continue
        look = {**style.looks(list(ALGORITHMS).index(algorithm)), "lw": 0.8}
        label = algorithm if kind == "published" else f"{algorithm}, {kind}"
        for _, seed in itertools.groupby(found, lambda line: line["seed"]):
            rows = list(seed)
            minutes = [float(row["core_seconds"]) / 60.0 for row in rows]
            shade = {} if kind == "published" else {"alpha": 0.5, "linestyle": ":"}
            (handles[label],) = panels[env].plot(minutes, [float(row["score"]) for row in rows], **look | shade)
    for env, axes in panels.items():
        style.dress(axes, title=env, xlabel="core-minutes", ylabel="score", ticks=4)
        axes.set_ylim(-0.2, 1.05)
        axes.set_xlim(left=0.0)
    style.legend(drawn, "Validation score, a line for each training seed", list(handles.values()), list(handles))
    return drawn


def main() -> None:
    """Trains what is missing, and writes the files."""
    command = tyro.cli(Command, description=__doc__)
    kept = {tuple(line[name] for name in RUN) for line in _read_curves()}
    missing = [one for one in command.trainings() if tuple(about(one).values()) not in kept]
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(command.workers, context) as pool:
        jobs = {pool.submit(curve, one): about(one) for one in missing}
        for done, job in enumerate(concurrent.futures.as_completed(jobs), 1):
            new = job.result()
            lines = [line for line in _read_curves() if not _same(line, jobs[job])] + new
            lines.sort(key=lambda line: (*(line[name] for name in RUN if name != "digest"), float(line["steps"])))
            write(CURVES, to_csv(lines).encode())
            print(f"{done} of {len(jobs)}: {' '.join(jobs[job].values())}: {new[-1]['score']}", flush=True)
    write(TABLE, to_csv(table(_read_curves())).encode())
    write(PICTURE, style.small_png(picture(_read_curves())))


def _read_curves() -> list[Line]:
    """The lines of the curves; another process may add some."""
    return from_csv(CURVES.read_text(encoding="utf-8")) if CURVES.exists() else []


def _groups(lines: Sequence[Line]) -> dict[tuple[str, ...], list[Line]]:
    out: dict[tuple[str, ...], list[Line]] = {}
    for line in lines:
        out.setdefault(tuple(line[name] for name in GROUP), []).append(line)
    return out


def _same(line: Line, run: Line) -> bool:
    """Whether a line is of this run, also with other settings."""
    return all(line[name] == run[name] for name in RUN if name != "digest")


if __name__ == "__main__":
    main()
