"""Runs that take a moment, for the tests of training."""

import json
import pathlib
from typing import Any

from baselines.training.apg import Trainer
from baselines.training.options import APG

#: Options that make a run short.
TINY: dict[str, Any] = {
    "scenario": "varga7-random",
    "steps": 100,
    "segments": 3,
    "evaluate_every": 2,
    "validation_episodes": 2,
    "n_envs": 4,
    "hidden": (8, 8),
    "offsets": (1, 2, 10),
    "hold": 8,
    "segment_steps": 48,
    "window": (16, 48),
}


def tiny(**changes: Any) -> APG:
    """A configuration that is trained within a second or two."""
    return APG(**{**TINY, **changes})


def trainer_of(config: APG, seed: int = 1) -> Trainer:
    """The trainer of a configuration, before its first segment."""
    return Trainer(config, config.make_scenario(), seed)


def about(folder: pathlib.Path) -> dict[str, Any]:
    """The run.json of a run."""
    content: dict[str, Any] = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    return content


def timeless(folder: pathlib.Path) -> list[dict[str, Any]]:
    """The history of a run, without times."""
    rows = about(folder)["history"]
    return [{name: value for name, value in row.items() if name != "core_minutes"} for row in rows]
