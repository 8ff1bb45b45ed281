"""The loop that steps episodes, and the sum of their costs: one of each, for evaluation, training and oracle alike."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from ikgym.scenarios import Preview, Scenario
from ikgym.simulation import Outcome
from ikgym.simulator import Simulator
from ikgym.validation import FloatArray

#: From what the arms show to the actions that move them, of shape (B, n), or (n,) for a single arm.
Act = Callable[[Outcome], npt.NDArray[Any]]


def play(
    scenario: Scenario,
    seeds: Sequence[int],
    act: Act,
    *,
    preview: Preview,
    single: bool = False,
    commands: int = 0,
    arm_seeds: Sequence[int | None] | None = None,
) -> Iterator[Outcome]:
    """Plays episodes in step, from their resets to their ends.

    Args:
        scenario: What is to be tracked.
        seeds: The reset seeds, one an arm.
        act: Called before each step with what all arms show.
        preview: Steps ahead that the nominal coordinates are shown.
        single: Whether there is one arm, whose actions have no row axis.
        commands: How many of the last commands are shown.
        arm_seeds: Seeds of the arms that are kept, one an arm, None where it is drawn with the episode.

    Yields:
        What came of each step, as arrays with an axis of arms; it stays as it is when the next step is made.

    Raises:
        InvalidInputError: The preview or the number of commands is not valid, or an arm cannot be kept.
    """
    rows = len(seeds)
    simulator = Simulator(scenario, None if single else rows, preview, commands=commands)
    generators = [seeding.np_random(seed)[0] for seed in seeds]
    arms = simulator.checked_arm_seeds(arm_seeds)
    simulator.reset(np.ones(rows, dtype=np.bool_), generators, arm_seeds=arms)
    out = simulator.observe()
    for _ in range(scenario.steps):
        out = simulator.step(act(out))
        yield out


def added_up(costs: FloatArray) -> FloatArray:
    """Sums over the steps, the last axis, from left to right: as everybody adds up rewards, bit for bit."""
    # NumPy's sum() goes pairwise and differs in the last bits.
    total: FloatArray = np.cumsum(costs, axis=-1)[..., -1]
    return total
