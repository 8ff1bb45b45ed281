"""Trainers that are made, and play some segments, as a run has them."""

from __future__ import annotations

from baselines.training import methods
from baselines.training.randomness import reseed


def made(config, seed=1):
    """The trainer of a configuration, before its first segment."""
    reseed(seed, None)
    return methods.get(config.method).make(config, config.make_scenario(), seed)


def play_segments(trainer, numbers, seed=1):
    """The metrics of some segments."""
    metrics = []
    for number in numbers:
        reseed(seed, number)
        metrics.append(trainer.segment(number))
    return metrics
