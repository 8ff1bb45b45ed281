"""Runs that take a moment: what the tests of the training have in common."""

from __future__ import annotations

import dataclasses
import json
import pathlib
from typing import Any

from baselines.training import methods
from baselines.training.config.base import Config

#: Options of a run on an arm of three joints, 20 steps an episode.
TINY: dict[str, Any] = {
    "scenario": "faitli3-regular",
    "steps": 20,
    "hidden": (8, 8),
    "offsets": (1, 2, 10),
    "segments": 3,
    "evaluate_every": 2,
    "validation_episodes": 2,
    "n_envs": 4,
    "batch_size": 20,
}
#: Random episodes of seven joints, over a policy with a memory.
OVER: dict[str, Any] = {**TINY, "scenario": "varga7-random", "base_policy": "mfac", "action_scale": 0.5}


#: What else makes a run of a method short.
FEW: dict[str, dict[str, Any]] = {
    "ppo": {},
    "sac": {"buffer_size": 200, "train_freq": 5, "gradient_steps": 2},
    "td3": {"buffer_size": 200, "train_freq": 5, "gradient_steps": 2},
    "imitate": {"expert": "dls", "gradient_steps": 3},
    "apg": {"hold": 4, "window": (8, 16), "segment_steps": 16},
}


def tiny(method: str, **changes: Any) -> Config:
    """A configuration that is trained within a second."""
    kind = methods.get(method).config
    known = {field.name for field in dataclasses.fields(kind)}
    usual = {name: value for name, value in TINY.items() if name in known}
    return kind(**{**usual, **FEW[method], **{name: value for name, value in changes.items() if name in known}})


def about(folder: pathlib.Path) -> dict[str, Any]:
    """The run.json of a run."""
    content: dict[str, Any] = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    return content


def timeless(folder: pathlib.Path) -> list[dict[str, Any]]:
    """The history of a run, without what a clock said."""
    rows = json.loads((folder / "history.json").read_text(encoding="utf-8"))
    return [{name: value for name, value in row.items() if name != "core_minutes"} for row in rows]
