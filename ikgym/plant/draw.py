"""Draws of a plant, once an episode."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from ikgym.arms import Arm
from ikgym.plant.arm_kernels import Arms, Spread, draw_arms, draw_loops
from ikgym.plant.plant import Plant
from ikgym.validation import FloatArray, whole_number

Keys = npt.NDArray[np.uint64]


@dataclasses.dataclass(frozen=True, eq=False)
class DrawnPlant:
    """The plant of an episode as it was drawn: privileged information, which no policy sees but a reference.

    Args:
        arm: The arm that moves before the payload is taken up, with the limits of the arm in the data sheet.
        loaded_arm: The arm that moves afterwards; the same where there is no payload.
        payload_step: Steps made when the payload is taken up.
        bandwidth: Of the velocity loops in [Hz], inf for none.
        command_delay: Steps after which a command reaches the drive.
    """

    arm: Arm
    loaded_arm: Arm
    payload_step: int
    bandwidth: float
    command_delay: int


class Draws:
    """Draws plants of many episodes.

    Args:
        plant: The plant.
        arm: The arm of the data sheet.
    """

    def __init__(self, plant: Plant, arm: Arm) -> None:
        self._plant, self._arm = plant, arm
        chains = [one.chain for one in plant.arms or (arm,)]
        n = arm.joints
        self._spread = Spread(
            np.array([chain.offsets for chain in chains]),
            np.array([chain.axes for chain in chains]),
            np.array(chains[0].prismatic),
            np.array([chain.tool for chain in chains]),
            np.array([chain.tool_rotation for chain in chains]),
            np.array(np.broadcast_to(plant.zero, n), dtype=np.float64),
            np.array(np.broadcast_to(plant.payload, n), dtype=np.float64),
            plant.link,
            plant.axis,
        )
        self._bandwidth = np.array(np.broadcast_to(plant.bandwidth, 2), dtype=np.float64)
        self._delay = np.array(np.broadcast_to(plant.command_delay, 2), dtype=np.int64)

    def blank(self, rows: int) -> Arms:
        """Empty arrays for so many arms."""
        n = self._arm.joints
        return Arms(
            np.zeros((rows, 2, n, 3)), np.zeros((rows, 2, n, 3)), np.zeros((rows, 2, 3)), np.zeros((rows, 2, 3, 3))
        )

    def arms(self, keys: Keys, rows: npt.NDArray[np.int64], out: Arms) -> None:
        """Draws the arms of some rows.

        Args:
            keys: One a row. Shape (k,).
            rows: The numbers of the rows. Shape (k,).
            out: Receives the arms.
        """
        draw_arms(self._spread, keys, rows, out)

    def loops(self, keys: Keys) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """Bandwidths in [Hz] and delays of commands in steps. Shapes (k,)."""
        bandwidths, delays = np.empty(len(keys)), np.empty(len(keys), dtype=np.int64)
        draw_loops(self._bandwidth, self._delay, keys, bandwidths, delays)
        return bandwidths, delays

    def one(self, key: int) -> DrawnPlant:
        """The plant that a key draws."""
        keys, out = np.array([key], dtype=np.uint64), self.blank(1)
        self.arms(keys, np.zeros(1, dtype=np.int64), out)
        bandwidths, delays = self.loops(keys)
        before, after = (self._made(*(part[0, loaded] for part in out)) for loaded in range(2))
        loaded = after if np.any(self._plant.payload) else before
        return DrawnPlant(before, loaded, self._plant.payload_step, float(bandwidths[0]), int(delays[0]))

    def _made(self, offsets: FloatArray, axes: FloatArray, tool: FloatArray, tool_rotation: FloatArray) -> Arm:
        return self._arm.replace(offsets=offsets, axes=axes, tool=tool, tool_rotation=tool_rotation)


def episode_key(plant: Plant, generator: np.random.Generator) -> int:
    """The key from which an episode's plant is drawn; an ideal plant does not touch the generator."""
    if plant.ideal:
        return 0
    if isinstance(generator.bit_generator, np.random.PCG64):  # Gymnasium's: the same bits in a tenth of the time
        return int(generator.bit_generator.random_raw()) >> 1
    return int(generator.integers(2**63, dtype=np.uint64))


def arm_key(arm_seed: Any) -> int:
    """The key from which an arm is drawn that is kept.

    Raises:
        InvalidInputError: The seed is no whole number of at least 0.
    """
    seed = whole_number("arm_seed", arm_seed, at_least=0)
    return int(seeding.np_random(seed)[0].integers(2**63, dtype=np.uint64))
