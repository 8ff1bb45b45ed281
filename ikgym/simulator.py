"""N episodes of one scenario side by side: the core of both environments and of the evaluation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.arms.limits import limit_rows
from ikgym.kernels import motions, simulation
from ikgym.kernels.jit import announce
from ikgym.kernels.outcome import OBSERVED, Outcome, more_size, observation, outcome, size
from ikgym.kernels.outcome import Observation as Observation
from ikgym.kernels.simulation import Constants, State
from ikgym.kernels.threads import in_chunks
from ikgym.options import checked_arm_seeds, checked_starts, checked_steps, entered_states, take_actions
from ikgym.plant.rows import PlantRows
from ikgym.plant.step import step
from ikgym.scenarios import Scenario
from ikgym.scenarios.contacts import check_clear, draw_obstacles, plant_rows
from ikgym.scenarios.frames import MotionFrames, frames_of_rows
from ikgym.scenarios.preview import FARTHEST as FARTHEST
from ikgym.scenarios.preview import Preview, offsets
from ikgym.validation import FloatArray, check_memory, whole_number

# Rows worth a thread: below, handing over costs more than it saves.
GRAIN_STEP = 256
# Steps for which one arm alone computes frames at once: a call of the kernel takes as long as eight frames.
AT_ONCE = 8
# Joints held back of an arm without limits: a copy takes less time than a fresh array.
NONE_HELD = np.zeros(3, dtype=np.int64)


class Simulator:
    """States of N arms that track the same scenario, and the compiled step between them.

    Args:
        scenario: The tracking problem.
        rows: N, or None for one arm whose actions have no row axis.
        preview: How many steps ahead the nominal coordinates are shown: 1 … p for an int p, or those of a sequence.
        commands: How many of the last commands are shown.

    Raises:
        InvalidInputError: The preview or the number of commands is not valid, or there is no memory for the rows
            or steps.
    """

    def __init__(self, scenario: Scenario, rows: int | None, preview: Preview, commands: int = 0) -> None:
        joints, coordinates = scenario.joints, scenario.task.size
        commands = whole_number("commands", commands, at_least=0)
        ideal, self._late = scenario.plant.ideal and not commands and not scenario.collides, scenario.plant.late
        self._action_shape = (joints,) if rows is None else (rows, joints)
        # One arm has no rows that do not step, whose outcome would have to be zero.
        self._new = np.empty if rows is None else np.zeros
        rows = 1 if rows is None else rows
        self.scenario, self.rows, self._limited = scenario, rows, scenario.arm.limited
        self.preview = offsets(preview)
        self._nominal = frames_of_rows(scenario, rows, self.preview, AT_ONCE)
        shown = size(joints, coordinates, len(self.preview))
        if not ideal:
            obstacles = len(scenario.surroundings.boxes) if scenario.obstacles_shown else 0
            shown += more_size(joints, coordinates, commands, obstacles)
        kept = 0 if ideal else PlantRows.size(scenario.plant, joints, coordinates, commands)
        check_memory(f"{rows} environments", _bytes_of(rows, shown, math.prod(self._nominal.shape) + rows * kept))
        self._shared = Constants(
            kind=scenario.task.kind,
            dt=scenario.dt,
            velocity_limit=scenario.velocity_limit,
            steps=scenario.steps,
            point=self._nominal.slots,
            counted=scenario.counted(),
            preview=np.array(self.preview, dtype=np.int64),
            limits=limit_rows(scenario.arm, scenario.largest_qdot, scenario.dt),
        )
        self._state = State(
            actions=np.zeros((rows, joints)),
            q=np.zeros((rows, joints)),
            qdot=np.zeros((rows, joints)),
            step=np.zeros(rows, dtype=np.int64),
            frames=self._nominal.allocate(),
        )
        self._plant = None if ideal else plant_rows(scenario, rows, commands)
        self._shape = (rows, joints, coordinates, len(self.preview), *(() if ideal else (commands, obstacles)))
        self._count, usual = rows * shown, rows * size(joints, coordinates, len(self.preview))
        self._told, self._held = slice(usual - 8, usual - 3), slice(usual - 3, usual)
        # Places in the block of the parts of an observation: those always there, and the others with their shapes.
        numbered = self._outcome(np.arange(self._count, dtype=np.float64))
        seen, met = observation(numbered, 0), (numbered.clearance, numbered.stopped, numbered.proximity_cost)
        self._met = [int(part[0]) for part in met] if scenario.collides else []
        places = {key: slice(int(part.flat[0]), int(part.flat[-1]) + 1) for key, part in seen.items()}
        self._parts, self._nominal_shape = [places[key] for key in OBSERVED], seen["nominal"].shape
        self._more = [(key, places[key], seen[key].shape) for key in places if key not in OBSERVED]
        self._take_apart()
        self._all, self._own_start = np.ones(rows, dtype=np.bool_), np.zeros(rows, dtype=np.bool_)
        with announce("the simulation kernels"):
            simulation.first_not_finite(self._state.q, ~self._all)
            self._run(~self._all, self._new(self._count), moving=False)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        # Copied, read-only arrays can be written to: the kernels would be compiled once more for them.
        self._shared = self._shared._replace(velocity_limit=self.scenario.velocity_limit)
        self._take_apart()

    def reset(
        self,
        active: npt.NDArray[np.bool_],
        generators: Sequence[np.random.Generator] | Mapping[int, np.random.Generator],
        starts: FloatArray | None = None,
        arm_seeds: Sequence[int | None] | None = None,
        noise_seeds: Sequence[int] | None = None,
        steps: npt.NDArray[np.int64] | None = None,
    ) -> None:
        """Begins new episodes.

        Args:
            active: The rows to reset. Shape (N,).
            generators: One a row; each draws its row's trajectory and plant.
            starts: Of :meth:`check_options`; those of the scenario if left out. Shape (N, n).
            arm_seeds: Of :meth:`check_options`; arms are drawn with their episodes if left out.
            noise_seeds: Which noise of drives and sensors, one a row; 0 is that of the generator, as if left out.
            steps: Of :meth:`check_options`: episodes are entered after these steps. Shape (N,).
        """
        scenario, state = self.scenario, self._state
        rows = np.flatnonzero(active)
        if len(rows) == 0:
            return
        rngs = [generators[row] for row in rows.tolist()]
        episodes = scenario.trajectory.samples(rngs)
        steps = np.zeros(len(rows), dtype=np.int64) if steps is None else steps[rows]
        q = scenario.first_q_of(episodes) if starts is None else starts[rows]
        if self._plant is not None:
            shift_start = scenario.shift_start if scenario.shifts_start and starts is None else None
            self._plant.begin(rows, rngs, arm_seeds, noise_seeds, q, shift_start)
            if scenario.draws_obstacles and self._plant.contacts is not None:
                draw_obstacles(scenario, self._plant.contacts, rows, episodes, rngs)
        state.q[rows], state.qdot[rows], state.step[rows] = q, 0.0, 0
        self._own_start[rows], self._ready = starts is None, 0
        if scenario.random:
            self._nominal.begin(state.frames, rows, episodes)
        if steps.any():
            later = steps > 0
            entered = rows[later]
            if starts is None:
                state.q[entered], state.qdot[entered] = entered_states(scenario, self._nominal.point, episodes, steps)
            if self._plant is not None:
                # Sensors and drives remember an arm that has always been as it is now: its first measurement.
                self._run(np.isin(np.arange(self.rows), entered), self._new(self._count), moving=False)
                self._plant.settle(entered, state.qdot[entered], steps[later])
            state.step[entered] = steps[later]

    def check_options(self, options: Mapping[str, Any]) -> dict[str, Any]:
        """Arguments of :meth:`reset` from the options of an environment's reset.

        Raises:
            InvalidInputError: A value is refused.
        """
        rows, scenario = self.rows, self.scenario
        return {
            "starts": checked_starts(options.get("q"), rows, scenario),
            "arm_seeds": checked_arm_seeds(options.get("arm_seed"), rows, scenario),
            "steps": checked_steps(options.get("step"), rows, scenario),
        }

    def observe(self, active: npt.NDArray[np.bool_] | None = None, out: Outcome | None = None) -> Outcome:
        """The outcome before a step.

        Args:
            active: The rows to observe, all if left out. Shape (N,).
            out: Where to write; fresh arrays if left out, zero in the rows that are not observed.
        """
        out = self._outcome(self._new(self._count)) if out is None else out
        active = self._all if active is None else active
        self._run(active, out.numbers, moving=False)
        if self.scenario.initial_pose is not None:
            starting = active & self._own_start & (self._state.step == 0)
            out.pose[starting] = self.scenario.initial_pose
            if self._plant is not None:
                self._plant.state.shown[starting] = self.scenario.initial_pose
        if self._met:
            check_clear(self.scenario, out, active, self._state.q)
        return out

    def step(self, actions: npt.ArrayLike, active: npt.NDArray[np.bool_] | None = None) -> Outcome:
        """One step of the active rows.

        Args:
            actions: Joint velocities as fractions of the velocity limit; clipped to ±1. Shape (N, n).
            active: The rows to step, all if left out. Shape (N,).

        Returns:
            Fresh arrays, zero in the rows that do not step.

        Raises:
            InvalidInputError: The actions have a wrong shape or type, or one is not finite. Nothing has changed
                then.
        """
        active = self._all if active is None else active
        take_actions(actions, self._action_shape, active, self._state.actions)
        out = self._outcome(self._new(self._count))
        self._run(active, out.numbers, moving=True)
        return out

    def step_one(self, action: npt.ArrayLike) -> tuple[Observation, list[float], npt.NDArray[np.int64], list[float]]:
        """:meth:`step` of the only arm, in less time.

        Returns:
            The observation, without a row axis; costs, errors and whether the action was clipped; joints held back;
            where bodies can touch, the clearance in [m], 1 for an arm that is stopped, and Φ^C, else nothing.
        """
        take_actions(action, self._action_shape, self._all, self._state.actions)
        self._numbers = numbers = np.empty(self._count)
        if self._motions and (made := int(self._state.step[0])) >= self._ready:
            self._ready = made + AT_ONCE
            motions.complete(*self._motions, self._all, True, AT_ONCE, 0, 1)
        self._step(numbers, self._all, True, 0, 1)
        q, qdot, pose, nominal, remaining = self._parts
        seen = {
            "q": numbers[q],
            "qdot": numbers[qdot],
            "pose": numbers[pose],
            "nominal": numbers[nominal].reshape(self._nominal_shape),
            "remaining": numbers[remaining],
        }
        for key, where, shape in self._more:
            seen[key] = numbers[where].reshape(shape)
        held = numbers[self._held].astype(np.int64) if self._limited else NONE_HELD.copy()
        return seen, numbers[self._told].tolist(), held, [float(numbers[place]) for place in self._met]

    def nominal_positions(self, row: int) -> FloatArray:
        """The nominal positions of a row's episode in [m], one a step. Shape (steps + 1, 3)."""
        return self._nominal.positions(row)

    def obstacles(self, row: int) -> FloatArray | None:
        """The obstacles of a row now; None where touching does not matter. Shape (o, 16)."""
        if self._plant is None or self._plant.contacts is None:
            return None
        boxes, step = self._plant.contacts.boxes, int(self._state.step[row])
        now: FloatArray = boxes[row % len(boxes), min(step, boxes.shape[1] - 1)]
        return now

    @property
    def outcome(self) -> Outcome:
        """All of the last step that :meth:`step_one` has made."""
        return self._outcome(self._numbers)

    @property
    def true_q(self) -> FloatArray:
        """True joint coordinates, in [rad] or [m]. Shape (N, n)."""
        return self._state.q

    @property
    def context(self) -> FloatArray:
        """The contexts of the rows' episodes, see :class:`ikgym.plant.DrawnPlant`. Shape (N, c)."""
        return np.zeros((self.rows, 0)) if self._plant is None else self._plant.context

    @property
    def steps_made(self) -> npt.NDArray[np.int64]:
        """Steps made in each row's episode. Shape (N,)."""
        return self._state.step

    def _run(self, active: npt.NDArray[np.bool_], numbers: FloatArray, *, moving: bool) -> None:
        grain = GRAIN_STEP * self.rows // max(int(np.count_nonzero(active)), 1)
        in_chunks(lambda start, stop: self._rows(active, numbers, moving, start, stop), self.rows, grain)

    def _rows(self, active: npt.NDArray[np.bool_], numbers: FloatArray, moving: bool, start: int, stop: int) -> None:
        if self._motions:
            motions.complete(*self._motions, active, moving, 1, start, stop)
        self._step(numbers, active, moving, start, stop)

    def _step(self, *command: Any) -> None:
        step(*self._constants, *command)

    def _take_apart(self) -> None:
        """The constant arguments of :func:`ikgym.plant.step.step`."""
        plant, cost, state = self._plant, self.scenario.cost.parameters, self._state
        of_plant: tuple[Any, ...] = (), None
        if plant is not None:
            of_plant = (plant.drives, plant.sensors, plant.arms, plant.state), plant.contacts
        self._constants: tuple[Any, ...] = *self.scenario.arm.chain, *self._shared, *cost, *state, *of_plant
        nominal, more = self._nominal, (state.frames, state.step)
        self._motions = (*nominal.arguments(), *more) if isinstance(nominal, MotionFrames) else ()

    def _outcome(self, numbers: FloatArray) -> Outcome:
        return outcome(numbers, *self._shape, late=self._late)


def _bytes_of(rows: int, shown: int, frames: int) -> int:
    """About how much memory N arms take, in bytes, by the numbers that a row shows and those of all nominal frames."""
    # Observations have copies: state, actions, bounds of the spaces. A row's generator takes the rest.
    return rows * (5 * 8 * shown + 1500) + 8 * frames
