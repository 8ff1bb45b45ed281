"""Runs in processes that are killed at random moments."""

import multiprocessing
import pathlib
import time
from typing import Any

import numpy as np

from baselines.training.config import APG
from baselines.training.run import train

#: Its server has loaded all that a run needs, so that a process begins at once.
_context = multiprocessing.get_context("forkserver")
_context.set_forkserver_preload(["tests.baselines.training.killing"])


def _start(config: APG, folder: pathlib.Path) -> Any:
    process = _context.Process(target=train, args=(config, 3, folder), kwargs={"resume": True}, daemon=True)
    process.start()
    return process


def run_until_done(config: APG, folder: pathlib.Path) -> float:
    """An undisturbed run; its duration in [s]."""
    begin, process = time.monotonic(), _start(config, folder)
    process.join()
    assert process.exitcode == 0
    return time.monotonic() - begin


def run_with_kills(config: APG, folder: pathlib.Path, kills: int, longest: float, rng: np.random.Generator) -> int:
    """A run that is killed at most `kills` times, each within `longest` seconds, and resumed; the number of kills."""
    killed = 0
    while True:
        process = _start(config, folder)
        process.join(longest * rng.random() if killed < kills else None)
        if not process.is_alive():
            assert process.exitcode == 0
            return killed
        process.kill()
        process.join()
        killed += 1
