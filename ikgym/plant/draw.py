"""Draws of a plant, once an episode."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding
from numpy.random import PCG64

from ikgym.arms import Arm
from ikgym.plant.arm_kernels import RANGE_STREAMS, Arms, Numbers, Ranges, Spread, draw_arms, draw_ranges
from ikgym.plant.checks import PerJoint, is_range
from ikgym.plant.contact import turn_bodies
from ikgym.plant.plant import Plant, scale
from ikgym.validation import FloatArray, whole_number

Keys = npt.NDArray[np.uint64]


@dataclasses.dataclass(frozen=True, eq=False)
class DrawnPlant:
    """The plant of an episode as it was drawn: privileged information, which no policy sees but a reference.

    Args:
        arm: The arm that moves before the payload is taken up, with the limits of the arm in the data sheet.
        loaded_arm: The arm that moves afterwards; the same where there is no payload.
        payload_step: Steps made when the payload is taken up.
        bandwidth: Of the velocity loops in [Hz], inf for none. A number, or one a joint.
        command_delay: Steps after which a command reaches the drive. A number, or one a joint.
        payload: Shift of the joints' zeros by the payload, in [rad] or [m].
        context: All that was drawn from a range, see :attr:`Plant.context`: -1 at its lower end, 1 at its upper end.
            Shape (c,).
    """

    arm: Arm
    loaded_arm: Arm
    payload_step: int
    bandwidth: PerJoint
    command_delay: PerJoint
    payload: PerJoint
    context: FloatArray


class Draws:
    """Draws plants of many episodes.

    Args:
        plant: The plant.
        arm: The arm of the data sheet.
    """

    def __init__(self, plant: Plant, arm: Arm) -> None:
        self._plant, self._arm, self._shapes = plant, arm, arm.bodies.shapes
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
        low, high = np.array([plant.ends(name) for name in Numbers._fields], dtype=np.float64).T
        whole = np.array([name in ("command_delay", "pose_every") for name in Numbers._fields])
        streams = np.array(RANGE_STREAMS, dtype=np.uint64)
        self._ranges = Ranges(low.copy(), high.copy(), whole, streams, *plant.from_middle)

    def blank(self, rows: int) -> Arms:
        """Empty arrays for N arms."""
        n = self._arm.joints
        return Arms(
            np.zeros((rows, 2, n, 3)), np.zeros((rows, 2, n, 3)), np.zeros((rows, 2, 3)), np.zeros((rows, 2, 3, 3))
        )

    def arms(self, keys: Keys, rows: npt.NDArray[np.int64], numbers: Numbers, out: Arms) -> None:
        """Draws the arms of some rows.

        Args:
            keys: One a row. Shape (k,).
            rows: The numbers of the rows. Shape (k,).
            numbers: Drawn from ranges by the keys.
            out: Receives the arms.
        """
        draw_arms(self._spread, keys, rows, numbers.calibration, numbers.load, out)

    def bodies(
        self, keys: Keys, rows: npt.NDArray[np.int64], numbers: Numbers, axes: FloatArray, out: tuple[FloatArray, ...]
    ) -> None:
        """Turns the bodies of some rows by the zeros of their joints.

        Args:
            keys: One a row. Shape (k,).
            rows: The numbers of the rows. Shape (k,).
            numbers: Drawn from ranges by the keys.
            axes: Axes of the arms that were drawn. Shape (N, 2, n, 3).
            out: Receives both ends of the bodies in [m]. Shapes (N, 2, b, 3).
        """
        shapes, factors = self._shapes, (numbers.calibration, numbers.load)
        turn_bodies(self._spread, keys, rows, *factors, axes, shapes.links, (shapes.starts, shapes.ends), out)

    def numbers(self, keys: Keys) -> tuple[Numbers, FloatArray]:
        """Numbers drawn from ranges, and the contexts. Shapes (k,), (k, c)."""
        out, context = np.empty((len(Numbers._fields), len(keys))), np.empty((len(keys), len(self._plant.context)))
        draw_ranges(self._ranges, keys, out, context)
        return Numbers(*out), context

    def one(self, key: int) -> DrawnPlant:
        """The plant that a key draws."""
        plant = self._plant
        if not (plant.other_arm or plant.context or np.any(plant.payload)):  # nothing to draw, and no kernel to compile
            drives = _known(plant.bandwidth, np.inf), _known(plant.command_delay, 0), plant.payload
            return DrawnPlant(self._arm, self._arm, plant.payload_step, *drives, context=np.empty(0))
        keys, out = np.array([key], dtype=np.uint64), self.blank(1)
        numbers, context = self.numbers(keys)
        self.arms(keys, np.zeros(1, dtype=np.int64), numbers, out)
        ends = np.empty((2, 1, 2, len(self._arm.bodies), 3))
        self.bodies(keys, np.zeros(1, dtype=np.int64), numbers, out.axes, (ends[0], ends[1]))
        before, after = (self._make_arm(ends[:, 0, loaded], *(part[0, loaded] for part in out)) for loaded in range(2))
        loaded = after if np.any(plant.payload) else before
        bandwidth = _known(plant.bandwidth, float(numbers.bandwidth[0]))
        delay, load = _known(plant.command_delay, int(numbers.command_delay[0])), float(numbers.load[0])
        payload = scale(plant.payload, load)
        return DrawnPlant(before, loaded, plant.payload_step, bandwidth, delay, payload, context[0])

    def _make_arm(self, ends: FloatArray, *chain: FloatArray) -> Arm:
        bodies = self._arm.bodies.replace(starts=ends[0], ends=ends[1])
        return self._arm.replace(**dict(zip(Arms._fields, chain, strict=True)), bodies=bodies)


def _known(value: Any, drawn: float) -> PerJoint:
    """The value of a field, or what was drawn where that is a range."""
    if not is_range(value):
        return value  # type: ignore[no-any-return]  # a field of a plant, which is checked
    return drawn if value[0] < value[1] else float(value[0])


def episode_key(plant: Plant, generator: np.random.Generator) -> int:
    """The key from which an episode's plant is drawn; an ideal plant does not touch the generator."""
    if plant.ideal:
        return 0
    bits = generator.bit_generator
    if isinstance(bits, PCG64):  # Gymnasium's: the same bits in a tenth of the time
        return bits.random_raw() >> 1
    return int(generator.integers(2**63, dtype=np.uint64))


def arm_key(arm_seed: Any) -> int:
    """The key from which an arm is drawn that is kept.

    Raises:
        InvalidInputError: The seed is no whole number of at least 0.
    """
    seed = whole_number("arm_seed", arm_seed, at_least=0)
    return int(seeding.np_random(seed)[0].integers(2**63, dtype=np.uint64))
