"""Runs in processes that are killed without a word."""

from __future__ import annotations

import multiprocessing
import pathlib
import time
from typing import Any

import numpy as np

from baselines.training.config.base import Config
from baselines.training.run import train

#: Its server has loaded all that a run needs, so that a process begins at once.
_context = multiprocessing.get_context("forkserver")
_context.set_forkserver_preload(["tests.baselines.training.killing"])


def start(config: Config, folder: pathlib.Path, **options: Any) -> Any:
    """A run with seed 3, in a process of its own."""
    process = _context.Process(target=_work, args=(config, folder, options), daemon=True)
    process.start()
    return process


def run_until_done(config: Config, folder: pathlib.Path) -> float:
    """An undisturbed run; how long it took, in [s]."""
    begin = time.monotonic()
    process = start(config, folder)
    process.join()
    assert process.exitcode == 0
    return time.monotonic() - begin


def run_with_kills(config: Config, folder: pathlib.Path, kills: int, longest: float, rng: np.random.Generator) -> int:
    """A run that is killed again and again after a random time, and gone on with.

    Args:
        config: What is run.
        folder: Where.
        kills: How often it is killed at most; it is then left alone.
        longest: Longest time until it is killed, in [s].
        rng: Draws the times.

    Returns:
        How often it was killed.
    """
    killed = 0
    while True:
        process = start(config, folder, resume=True)
        if killed < kills:
            process.join(longest * rng.random())
            if process.is_alive():
                process.kill()
                killed += 1
                process.join()
                continue
        process.join()
        assert process.exitcode == 0
        return killed


def _work(config: Config, folder: pathlib.Path, options: dict[str, Any]) -> None:
    train(config, 3, folder, **options)
