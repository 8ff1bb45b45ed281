"""The plants of N arms that are simulated side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.arms import Arm
from ikgym.kernels.kinematics import Chain
from ikgym.kernels.random_numbers import stream
from ikgym.kernels.threads import in_chunks
from ikgym.plant.arm_kernels import Numbers, stream_rows
from ikgym.plant.checks import is_range
from ikgym.plant.contact import Contacts
from ikgym.plant.draw import Draws, Keys, arm_key, episode_key
from ikgym.plant.plant import Plant
from ikgym.plant.response import PAST, Response
from ikgym.plant.sensor_kernels import STREAMS
from ikgym.plant.step import Drives, PlantState, Sensors
from ikgym.validation import FloatArray

# Numbers of the streams that other noises of an episode come from: more than there are effects.
NOISE_SEEDS = 1000
# Rows whose draws are worth a thread.
GRAIN = 64
Integers = npt.NDArray[np.int64]


class PlantRows:
    """Parameters and state of the plants of N arms, as kernels take them.

    Args:
        plant: The plant of the scenario.
        arm: The arm of the data sheet.
        dt: Δt in [s].
        rows: N.
        coordinates: m, of the task.
        commands: h, the number of past commands shown.
        contacts: Bodies and obstacles; None where touching does not matter.
    """

    def __init__(
        self,
        plant: Plant,
        arm: Arm,
        dt: float,
        rows: int,
        coordinates: int,
        commands: int,
        contacts: Contacts | None = None,
    ) -> None:
        self._plant, self._dt, n = plant, dt, arm.joints
        self.contacts = contacts
        self._draws = Draws(plant, arm)

        def every_joint(value: Any) -> FloatArray:
            return np.array(np.broadcast_to(value, n), dtype=np.float64)

        whole = every_joint(0.0 if is_range(plant.command_delay) else np.floor(plant.command_delay))
        self._response = Response.of(plant, n, dt)
        self.drives = Drives(
            every_joint(plant.bias),
            every_joint(plant.noise),
            every_joint(plant.backlash),
            every_joint(0.0 if is_range(plant.command_delay) else plant.command_delay) - whole,
            self._response.coefficients,
            every_joint(plant.gain),
            self._response.free,
            np.array(arm.chain.prismatic),
            plant.payload_step,
        )
        self.sensors = Sensors(
            every_joint(plant.q_noise),
            plant.q_delay,
            plant.pose_delay,
            plant.pose_missing,
        )
        self.arms = self._draws.blank(rows if plant.draws_arm else 1)
        self.context = np.zeros((rows, len(plant.context)))
        self.state = PlantState(
            keys=np.zeros((rows, STREAMS), dtype=np.uint64),
            lag=np.zeros((rows, n)),
            delay=np.zeros((rows, n), dtype=np.int64),
            pose_noise=np.zeros(rows),
            pose_rotation_noise=np.zeros(rows),
            pose_every=np.zeros(rows, dtype=np.int64),
            drive=np.zeros((rows, n)),
            play=np.zeros((rows, n)),
            past=np.zeros((rows, len(self._response.coefficients), PAST)),
            swing=np.zeros((rows, len(self._response.free), 3)),
            commands=np.zeros((rows, max(plant.longest_command_delay + 1, commands), n)),
            q=np.zeros((rows, plant.q_delay + 1, n)),
            pose=np.zeros((rows, plant.poses_underway, coordinates)),
            shown=np.zeros((rows, coordinates)),
            shown_step=np.zeros(rows, dtype=np.int64),
        )
        keys = np.zeros(rows, dtype=np.uint64)
        self._set_numbers(np.arange(rows), *self._draws.numbers(keys))
        self._draw(np.arange(rows), keys)

    @staticmethod
    def size(plant: Plant, joints: int, coordinates: int, commands: int) -> int:
        """Numbers that a row takes."""
        kept = joints * (plant.longest_command_delay + 1 + commands + plant.q_delay + 1)
        return 2 * (6 * joints + 12) + kept + coordinates * (plant.poses_underway + 1) + (6 + PAST + 3) * joints

    def begin(
        self,
        rows: Integers,
        generators: Sequence[np.random.Generator],
        arm_seeds: Sequence[int | None] | None,
        noise_seeds: Sequence[int] | None,
        q: FloatArray,
        jogged: Callable[[FloatArray, Chain], FloatArray] | None,
    ) -> None:
        """Draws the plants of new episodes.

        Args:
            rows: The rows that begin one. Shape (k,).
            generators: Of these rows.
            arm_seeds: One for each of the N rows: that of the arm that it keeps, None for one drawn with the episode.
            noise_seeds: Likewise, for the noise of drives and sensors; 0 is the noise of the episode.
            q: Starts of the arm of the data sheet in [rad] or [m], changed in place to those of the arms that move.
                Shape (k, n).
            jogged: See :meth:`ikgym.Scenario.shift_start`; None where all arms start at the same joint coordinates.
        """
        keys = arm_keys = [episode_key(self._plant, generator) for generator in generators]
        if arm_seeds is not None:
            kept = [arm_seeds[row] for row in rows.tolist()]
            arm_keys = [key if seed is None else arm_key(seed) for key, seed in zip(keys, kept, strict=True)]
        if noise_seeds is not None:
            keys = [noise_key(key, noise_seeds[row]) for key, row in zip(keys, rows.tolist(), strict=True)]
        stream_rows(np.array(keys, dtype=np.uint64), rows, self.state.keys)
        for array in (self.state.drive, self.state.play, self.state.past, self.state.swing):
            array[rows] = 0.0
        if self.contacts is not None:
            self.contacts.stopped[rows] = False
        of_arms = np.array(arm_keys, dtype=np.uint64)

        def work(first: int, last: int) -> None:
            part = slice(first, last)
            if self._plant.draws_arm:
                self._draw(rows[part], of_arms[part])
            if jogged is not None:
                offsets, axes, tool, tool_rotation = (array[rows[part] % len(array), 0] for array in self.arms)
                q[part] = jogged(q[part], Chain(offsets, axes, self.drives.prismatic, tool, tool_rotation))

        if self._plant.draws_arm or jogged is not None:
            in_chunks(work, len(rows), GRAIN)

    def _draw(self, rows: Integers, keys: Keys) -> None:
        """Draws the arms of some rows, their drives and sensors, by their keys. Shapes (k,)."""
        numbers, context = self._draws.numbers(keys)
        self._draws.arms(keys, rows % len(self.arms.offsets), numbers, self.arms)
        if self.contacts is not None:
            self._draws.bodies(keys, rows, numbers, self.arms.axes, (self.contacts.starts, self.contacts.ends))
        if context.size:
            self._set_numbers(rows, numbers, context)

    def _set_numbers(self, rows: Integers, numbers: Numbers, context: FloatArray) -> None:
        """Sets the numbers that rows have drawn from ranges."""
        plant = self._plant
        self.context[rows] = context
        self.state.lag[rows] = -np.expm1(-2.0 * np.pi * numbers.bandwidth * self._dt)[:, None]
        self.state.delay[rows] = numbers.command_delay[:, None]
        if isinstance(plant.bandwidth, tuple) and not is_range(plant.bandwidth):
            self.state.lag[rows] = -np.expm1(-2.0 * np.pi * np.array(plant.bandwidth) * self._dt)
        if not is_range(plant.command_delay):
            self.state.delay[rows] = np.floor(plant.command_delay)
        for name in ("pose_noise", "pose_rotation_noise", "pose_every"):
            getattr(self.state, name)[rows] = getattr(numbers, name)

    def settle(self, rows: Integers, qdot: FloatArray, steps: Integers) -> None:
        """Fills the histories of rows with their first measurement and a velocity, as after a long time of both.

        Args:
            rows: The rows, observed at their first step. Shape (k,).
            qdot: In [rad/s] or [m/s]. Shape (k, n).
            steps: Steps of the episodes made by then. Shape (k,).
        """
        state = self.state
        for ring in (state.q, state.pose):
            ring[rows] = ring[rows, :1]
        state.commands[rows], state.drive[rows], state.shown_step[rows] = qdot[:, None], qdot, steps
        reached = qdot * self._response.steady
        if state.past.size:
            state.past[rows] = np.repeat(np.stack([reached, qdot], axis=2), PAST // 2, axis=2)
        if state.swing.size:
            state.swing[rows, :, 2] = reached * self.drives.gain


def noise_key(key: int, noise_seed: int) -> int:
    """The key of an episode's noises: that of the episode, or that of a stream far from those of its effects."""
    return key if noise_seed == 0 else int(stream(np.uint64(key), NOISE_SEEDS + noise_seed))
