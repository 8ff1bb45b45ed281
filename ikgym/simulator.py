"""N episodes of one scenario side by side: what both environments and the evaluation run on."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from ikgym import simulation
from ikgym.compilation import announced
from ikgym.exceptions import InvalidInputError
from ikgym.parallel import in_chunks
from ikgym.scenarios import Preview, Scenario
from ikgym.simulation import Law, Outcome, State
from ikgym.validation import FloatArray, float_array

#: What a policy sees of an arm, see :func:`observation`.
Observation = dict[str, FloatArray]

# Rows worth a thread of their own: below, handing over costs more than it saves.
GRAIN_STEP = 256
GRAIN_RESET = 4

# A preview beyond would fill the memory before it served any policy.
FARTHEST = 1_000_000


class Simulator:
    """States of N arms that track the same scenario, and the compiled step between them.

    Args:
        scenario: The tracking problem.
        rows: N, or None for one arm whose actions have no row axis.
        preview: How many steps ahead the nominal coordinates are shown: an int p shows 1 … p, a sequence just
            those.

    Raises:
        InvalidInputError: The preview is not valid.
    """

    def __init__(self, scenario: Scenario, rows: int | None, preview: Preview) -> None:
        joints = scenario.joints
        self._action_shape = (joints,) if rows is None else (rows, joints)
        # One arm has no rows that do not step, whose outcome would have to be zero.
        self._new = np.empty if rows is None else np.zeros
        rows = 1 if rows is None else rows
        self.scenario, self.rows = scenario, rows
        self.preview = offsets(preview)
        points = scenario.points(preview)
        self._points = int(points[-1]) + 1
        self._law = Law(
            kind=scenario.task.kind,
            dt=scenario.dt,
            velocity_limit=scenario.velocity_limit,
            steps=scenario.steps,
            point=points,
            counted=scenario.counted(),
            preview=np.array(self.preview, dtype=np.int64),
            bias=np.broadcast_to(scenario.disturbance.bias, joints).astype(np.float64),
            noise=np.broadcast_to(scenario.disturbance.noise, joints).astype(np.float64),
        )
        tables = rows if scenario.random else 1
        width = 12 if scenario.task.has_orientation else 3
        self._state = State(
            q=np.zeros((rows, joints)),
            qdot=np.zeros((rows, joints)),
            step=np.zeros(rows, dtype=np.int64),
            frames=np.zeros((tables, self._points, width)),
            noise_key=np.zeros(rows, dtype=np.uint64),
        )
        if not scenario.random:
            self._state.frames[0] = scenario.frames(scenario.trajectory, self._points)
        # The kernels take tuples apart, see simulation.step: what never changes is taken apart once.
        self._constants = (*scenario.arm.chain, *self._law, *scenario.cost.parameters, *self._state)
        self._all = np.ones(rows, dtype=np.bool_)
        self._own_start = np.zeros(rows, dtype=np.bool_)
        with announced("the simulation kernels"):
            simulation.first_not_finite(self._state.q, ~self._all)
            for kernel in (simulation.step, simulation.observe):
                kernel(*self._constants, *self._outcome(), self._state.q, ~self._all, 0, 0)

    def reset(
        self,
        active: npt.NDArray[np.bool_],
        generators: Sequence[np.random.Generator] | Mapping[int, np.random.Generator],
        starts: FloatArray | None = None,
    ) -> None:
        """Begins new episodes.

        Args:
            active: The rows to reset. Shape (N,).
            generators: One a row; each draws its row's trajectory and disturbance.
            starts: What :meth:`checked_starts` gave; the scenario's own starts if left out. Shape (N, n).
        """
        scenario, state = self.scenario, self._state
        rows = np.flatnonzero(active).tolist()
        episodes = [scenario.trajectory.sample(generators[row]) for row in rows]
        noisy = bool(self._law.noise.any())

        def prepare(first: int, stop: int) -> None:
            for row, episode in zip(rows[first:stop], episodes[first:stop], strict=True):
                if scenario.random:
                    state.frames[row] = scenario.frames(episode, self._points)
                state.q[row] = scenario.first_q(episode) if starts is None else starts[row]

        in_chunks(prepare, len(rows), GRAIN_RESET if scenario.random else len(rows))
        if noisy:
            for row in rows:
                state.noise_key[row] = generators[row].integers(2**63, dtype=np.uint64)
        self._own_start[active] = starts is None
        state.qdot[active] = 0.0
        state.step[active] = 0

    def checked_starts(self, q: npt.ArrayLike | None) -> FloatArray | None:
        """Starts that a user asks for.

        Args:
            q: Joint coordinates in [rad] or [m], of shape (n,) for all rows, or (N, n). None for the scenario's own.

        Returns:
            One start a row, of shape (N, n), or None.

        Raises:
            InvalidInputError: A start has a wrong shape, is not finite or out of range.
        """
        if q is None:
            return None
        joints, bound = self.scenario.joints, self.scenario.start_bound()
        starts = float_array("options['q']", q)
        if starts.shape not in {(joints,), (self.rows, joints)}:
            raise InvalidInputError(f"options['q']: expected shape ({joints},), got {starts.shape}.")
        if (np.abs(starts) > bound).any():
            raise InvalidInputError(
                f"options['q']: expected absolute values of at most {np.round(bound, 4).tolist()} in [rad] or [m], "
                f"got {starts.tolist()}."
            )
        return np.broadcast_to(starts, (self.rows, joints))

    def observe(self, active: npt.NDArray[np.bool_] | None = None, out: Outcome | None = None) -> Outcome:
        """What the arms show before a step.

        Args:
            active: The rows to observe, all if left out. Shape (N,).
            out: Where to write; fresh arrays if left out, zero in the rows that are not observed.
        """
        out = self._outcome() if out is None else out
        active = self._all if active is None else active
        simulation.observe(*self._constants, *out, self._state.q, active, 0, self.rows)
        if self.scenario.initial_pose is not None:
            out.pose[active & self._own_start & (self._state.step == 0)] = self.scenario.initial_pose
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
        actions = self._checked_actions(actions)
        active = self._all if active is None else active
        bad = simulation.first_not_finite(actions, active)
        if bad >= 0:
            where = f" of row {bad}" if self.rows > 1 else ""
            raise InvalidInputError(
                f"action{where}: expected finite numbers, got {actions[bad].tolist()}. The state is as it was."
            )
        out = self._outcome()

        def work(start: int, stop: int) -> None:
            simulation.step(*self._constants, *out, actions, active, start, stop)

        in_chunks(work, self.rows, GRAIN_STEP)
        return out

    def nominal_positions(self, row: int) -> FloatArray:
        """The nominal positions of a row's episode in [m], one a step. Shape (steps + 1, 3)."""
        frames = self._state.frames[row if len(self._state.frames) > 1 else 0]
        positions: FloatArray = frames[self._law.point[: self.scenario.steps + 1], -3:]
        return positions

    @property
    def steps_made(self) -> npt.NDArray[np.int64]:
        """Steps made in each row's episode. Shape (N,)."""
        return self._state.step

    def _outcome(self) -> Outcome:
        rows, joints, size = self.rows, self.scenario.joints, self.scenario.task.size
        new = self._new
        return Outcome(
            new((rows, joints)),
            new((rows, joints)),
            new((rows, size)),
            new((rows, len(self.preview), size)),
            new((rows, 1)),
            new(rows),
            new(rows),
            new(rows),
            new(rows),
            new(rows, np.bool_),
        )

    def _checked_actions(self, actions: npt.ArrayLike) -> FloatArray:
        try:
            raw = np.asarray(actions)
        except ValueError:  # lists of different lengths
            raw = np.asarray(None)
        if raw.dtype.kind not in "fiub":
            raise InvalidInputError(f"action: expected numbers of shape {self._action_shape}, got {actions!r}.")
        if raw.shape != self._action_shape:
            raise InvalidInputError(f"action: expected shape {self._action_shape}, got {raw.shape}.")
        return np.array(raw, dtype=np.float64, order="C").reshape(self.rows, -1)


def observation(out: Outcome) -> Observation:
    """What a policy sees of the only arm: the observation of the environment, without a row axis."""
    return {
        "q": out.q[0],
        "qdot": out.qdot[0],
        "pose": out.pose[0],
        "nominal": out.nominal[0],
        "remaining": out.remaining[0],
    }


def offsets(preview: Preview) -> tuple[int, ...]:
    """The steps ahead that a preview shows.

    Args:
        preview: An int p for 1 … p, or a sequence of steps ahead.

    Raises:
        InvalidInputError: It is neither, or not rising, or below 1.
    """
    if isinstance(preview, (tuple, list)) and preview:
        ahead = tuple(preview)
        rising = all(map(_is_whole, ahead)) and all(a < b for a, b in itertools.pairwise(ahead))
        if rising and ahead[0] >= 1 and ahead[-1] <= FARTHEST:
            return tuple(int(step) for step in ahead)
    elif _is_whole(preview) and 1 <= preview <= FARTHEST:  # type: ignore[operator]  # a whole number
        return tuple(range(1, preview + 1))  # type: ignore[operator]
    raise InvalidInputError(
        "preview: expected a whole number of at least 1, or rising steps ahead such as (1, 10, 40), none above "
        f"{FARTHEST}, got {preview!r}."
    )


def _is_whole(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)
