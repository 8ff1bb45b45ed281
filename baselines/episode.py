"""The loop that steps episodes, and the sum of their costs: one of each, for evaluation, training and oracle alike."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from ikgym.scenarios import Preview, Scenario
from ikgym.simulation import Outcome
from ikgym.simulator import Simulator
from ikgym.validation import FloatArray


class Draw(NamedTuple):
    """What of an episode is drawn how.

    Attributes:
        seed: The reset seed: of the trajectory, and of all that is not said below.
        arm_seed: Which arm moves; the seed's own if it is None.
        noise_seed: Which noise there is in sensors and drives. 0 is the seed's own; policies that are compared are
            given the same.
    """

    seed: int
    arm_seed: int | None = None
    noise_seed: int = 0

    @classmethod
    def of(cls, seed: int | Draw) -> Draw:
        """A reset seed as a draw."""
        return seed if isinstance(seed, Draw) else cls(seed)


#: From what the arms show to the actions that move them, of shape (B, n), or (n,) for a single arm.
Act = Callable[[Outcome], npt.NDArray[Any]]


def play(
    scenario: Scenario,
    seeds: Sequence[int | Draw],
    act: Act,
    *,
    preview: Preview,
    single: bool = False,
    commands: int = 0,
) -> Iterator[Outcome]:
    """Plays episodes in step, from their resets to their ends.

    Args:
        scenario: What is to be tracked.
        seeds: The reset seeds, or what is drawn how, one an arm.
        act: Called before each step with what all arms show.
        preview: Steps ahead that the nominal coordinates are shown.
        single: Whether there is one arm, whose actions have no row axis.
        commands: How many of the last commands are shown.

    Yields:
        What came of each step, as arrays with an axis of arms; it stays as it is when the next step is made.

    Raises:
        InvalidInputError: The preview or the number of commands is not valid, or an arm cannot be kept.
    """
    rows = len(seeds)
    draws = [Draw.of(seed) for seed in seeds]
    simulator = Simulator(scenario, None if single else rows, preview, commands=commands)
    simulator.reset(
        np.ones(rows, dtype=np.bool_),
        [seeding.np_random(draw.seed)[0] for draw in draws],
        arm_seeds=simulator.checked_arm_seeds([draw.arm_seed for draw in draws]),
        noise_seeds=[draw.noise_seed for draw in draws],
    )
    out = simulator.observe()
    for _ in range(scenario.steps):
        out = simulator.step(act(out))
        yield out


def added_up(costs: FloatArray) -> FloatArray:
    """Sums over the steps, the last axis, from left to right: as everybody adds up rewards, bit for bit."""
    # NumPy's sum() goes pairwise and differs in the last bits.
    total: FloatArray = np.cumsum(costs, axis=-1)[..., -1]
    return total
