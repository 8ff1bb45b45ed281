"""Episodes: their seeds, their record, and the one loop that plays them, for all who evaluate, search and train."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import gc
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from baselines.policy.arguments import Report
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.outcome import observation
from ikgym.kernels.simulation import Outcome
from ikgym.scenarios import Preview, Scenario
from ikgym.simulator import Simulator
from ikgym.validation import FloatArray

#: Steps between two calls of a :data:`Tick`.
TICK = 100

#: Reports progress: called between timed calls, with the number of steps since the last call.
Tick = Callable[[int], object]


class Seeds(NamedTuple):
    """Random seeds of one episode.

    Attributes:
        seed: The reset seed: trajectory, plant, and everything that the others do not set.
        arm_seed: Arm and drives of the plant; those of the reset seed if None.
        noise_seed: Noise in sensors and drives; 0 is the noise of the reset seed. Policies that are compared get the
            same noise.
    """

    seed: int
    arm_seed: int | None = None
    noise_seed: int = 0

    @classmethod
    def of(cls, seed: int | Seeds) -> Seeds:
        """The seeds of a reset seed alone; seeds are returned as they are."""
        return seed if isinstance(seed, Seeds) else cls(seed)


#: Parts of an outcome that the record of an episode has under the same name.
_OUTCOME = ("qdot", "tracking_cost", "velocity_cost", "position_error", "orientation_error", "at_limit")


@dataclasses.dataclass(frozen=True, eq=False)
class Episode:
    """The record of one episode; row k belongs to step k, counted from 0.

    Args:
        scenario: The scenario, with as many steps as were played.
        seeds: The seeds of the episode.
        q: True joint coordinates after the step, in [rad] or [m]. Shape (steps, n).
        qdot: Joint velocities applied, in [rad/s] or [m/s]. Shape (steps, n).
        pose: True task coordinates after the step. Shape (steps, m).
        tracking_cost: Φ^X, 0 where the step does not count. Shape (steps,).
        velocity_cost: Φ^U, 0 where the step does not count. Shape (steps,).
        position_error: In [m]. Shape (steps,).
        orientation_error: Geodesic angle in [rad], NaN where the task has no orientation. Shape (steps,).
        at_limit: Joints held back by a stop, by the velocity and by the acceleration limit. Shape (steps, 3).
        status: Values of :class:`baselines.Status`. Shape (steps,).
        iterations: Iterations of the policy. Shape (steps,).
        time_ns: Wall time of the call of `predict`, in [ns]. Shape (steps,), or (0,) where the calls were not timed.
        diagnostics: Diagnostics of the policy by name, see :meth:`SolverPolicy.diagnostics`; each of shape (steps, …).
        clearance: Smallest signed distance between bodies in [m]; None, like the next two, where the scenario has no
            collisions. Shape (steps,).
        pair: The closest pair, and the one that touched where the arm stops, see
            :meth:`ikgym.Scenario.pair_names`; -1 where nothing can meet. Shape (steps, 2).
        stopped: 1 where bodies have touched and the arm has stopped, 0 elsewhere. Shape (steps,).
        proximity_cost: Φ^C, 0 where the step does not count; None where the scenario has no such cost. Shape (steps,).
    """

    scenario: Scenario
    seeds: Seeds
    q: FloatArray
    qdot: FloatArray
    pose: FloatArray
    tracking_cost: FloatArray
    velocity_cost: FloatArray
    position_error: FloatArray
    orientation_error: FloatArray
    at_limit: FloatArray
    status: npt.NDArray[np.int64]
    iterations: npt.NDArray[np.int64]
    time_ns: npt.NDArray[np.int64]
    diagnostics: dict[str, FloatArray]
    clearance: FloatArray | None = None
    pair: FloatArray | None = None
    stopped: FloatArray | None = None
    proximity_cost: FloatArray | None = None

    @property
    def cost(self) -> FloatArray:
        """The stage costs. Shape (steps,)."""
        cost: FloatArray = self.tracking_cost + self.velocity_cost
        return cost if self.proximity_cost is None else cost + self.proximity_cost


class Recording:
    """The record of episodes side by side, while they are played.

    Args:
        scenario: The scenario.
        seeds: The seeds of each episode.

    Attributes:
        time_ns: Wall times of the calls of `predict`, in [ns], of one episode whose calls are timed.
    """

    def __init__(self, scenario: Scenario, seeds: Sequence[int | Seeds]) -> None:
        self._scenario, self._seeds = scenario, [Seeds.of(seed) for seed in seeds]
        self._record: dict[str, npt.NDArray[Any]] = {}
        self._diagnostics: dict[str, npt.NDArray[Any]] = {}
        self.time_ns: list[int] = []

    def keep(self, step: int, out: Outcome, report: Report, diagnostics: Mapping[str, npt.NDArray[Any]]) -> None:
        """Keeps the outcome of a step, counted from 0, and what the policy reports."""
        values = {name: getattr(out, name) for name in _OUTCOME}
        values |= {"q": out.true_q, "pose": out.true_pose, "status": report.status, "iterations": report.iterations}
        if self._scenario.collides:
            values |= {"clearance": out.clearance, "pair": out.pair, "stopped": out.stopped}
        if self._scenario.proximity is not None:
            values["proximity_cost"] = out.proximity_cost
        for into, arrays in ((self._record, values), (self._diagnostics, diagnostics)):
            for name, array in arrays.items():
                if name not in into:
                    into[name] = np.empty((len(self._seeds), self._scenario.steps, *array.shape[1:]), dtype=array.dtype)
                into[name][:, step] = array

    def episodes(self) -> list[Episode]:
        """The episodes."""
        times = np.array(self.time_ns, dtype=np.int64)
        return [
            Episode(
                self._scenario,
                seeds,
                **{name: values[row] for name, values in self._record.items()},
                time_ns=times,
                diagnostics={name: values[row] for name, values in self._diagnostics.items()},
            )
            for row, seeds in enumerate(self._seeds)
        ]


def add_up(costs: FloatArray) -> FloatArray:
    """Sums over the steps, the last axis, from left to right, as a loop over rewards does, bit for bit."""
    # NumPy's sum() goes pairwise and differs in the last bits.
    total: FloatArray = np.cumsum(costs, axis=-1)[..., -1]
    return total


class Policy(Protocol):
    """The part of :class:`baselines.SolverPolicy` that the loop of episodes needs."""

    @property
    def name(self) -> str:
        """The name in messages."""

    @property
    def preview(self) -> Preview:
        """Steps ahead that the policy needs of the reference trajectory, or a tuple of which ones."""

    @property
    def commands(self) -> int:
        """Number of past commands that the policy needs."""

    @property
    def batched(self) -> bool:
        """Whether `predict` accepts the observations of several arms at once."""

    def predict(self, observation: Any, state: Any = None, episode_start: Any = None) -> tuple[npt.NDArray[Any], Any]:
        """Actions, and the state for the next call, which is never None."""

    def report(self, state: Any) -> Report:
        """Status and iterations of the call that returned a state."""

    def diagnostics(self, state: Any) -> dict[str, FloatArray]:
        """Diagnostics of the call that returned a state, by name."""


def begin(
    scenario: Scenario, seeds: Sequence[int | Seeds], *, preview: Preview, single: bool = False, commands: int = 0
) -> tuple[Simulator, Outcome]:
    """Arms side by side at the start of their episodes, and the outcome before the first step.

    Args:
        scenario: The scenario.
        seeds: Seeds of the episodes, one an arm.
        preview: Steps ahead that the reference trajectory is shown, or which ones.
        single: Whether there is one arm, whose actions have no batch axis.
        commands: Number of past commands that are shown.

    Raises:
        InvalidInputError: The preview or the number of commands is invalid, or the plant draws no arm by seed.
    """
    drawn = [Seeds.of(seed) for seed in seeds]
    arms = Simulator(scenario, None if single else len(seeds), preview, commands=commands)
    arms.reset(
        np.ones(len(seeds), dtype=np.bool_),
        [seeding.np_random(one.seed)[0] for one in drawn],
        noise_seeds=[one.noise_seed for one in drawn],
        **arms.check_options({"arm_seed": [one.arm_seed for one in drawn]}),
    )
    return arms, arms.observe()


def rollout(
    scenario: Scenario,
    policy: Policy,
    seed: int | Seeds,
    *,
    preview: Preview | None = None,
    timed: bool = True,
    tick: Tick | None = None,
) -> Episode:
    """Plays one episode, see :func:`rollouts`."""
    return rollouts(scenario, policy, [seed], preview=preview, timed=timed, tick=tick)[0]


def rollouts(
    scenario: Scenario,
    policy: Policy,
    seeds: Sequence[int | Seeds],
    *,
    preview: Preview | None = None,
    timed: bool = False,
    tick: Tick | None = None,
    in_a_row: int = 1,
) -> list[Episode]:
    """Plays episodes, with one call of the policy for all of them in each step where that is possible.

    Bit-identical to `gym.make("RedundantIK-v0", scenario=…)`, reset with each seed and stepped with the policy; without
    Gymnasium's wrappers and the float32 rewards of Stable-Baselines3. Timed, or with a policy that takes no batch, one
    episode is played after the other.

    Args:
        scenario: The scenario.
        policy: The policy.
        seeds: The reset seed of each episode, or all of its seeds.
        preview: Steps ahead that the policy is shown; the policy's if left out.
        timed: Whether the calls are timed.
        tick: Reports progress, the steps of all episodes.
        in_a_row: Number of episodes that follow one another, so that the policy keeps its state: it can use in later
            ones the arm that it has learned. `predict` receives `episode_start` where the next one begins; memory that
            does not survive it is cleared.

    Raises:
        InvalidInputError: The preview is invalid or shorter than the policy needs; an action is not finite or has a
            wrong shape.
    """
    single = timed or not policy.batched
    shown: dict[str, Any] = {"preview": policy.preview if preview is None else preview, "commands": policy.commands}
    chains = [seeds[first : first + in_a_row] for first in range(0, len(seeds), in_a_row)]
    episodes: list[Episode] = []
    for group in [[chain] for chain in chains] if single else [chains]:
        state, played = None, []
        for together in zip(*group, strict=True):
            arms, out = begin(scenario, together, single=single, **shown)
            record, row = Recording(scenario, together), 0 if single else None
            # A policy without a state knows that an episode begins.
            start: dict[str, Any] = {} if state is None else {"episode_start": np.ones(len(together), dtype=np.bool_)}
            with _no_garbage_collection():
                for step in range(scenario.steps):
                    seen = observation(out, row)
                    if step == 0:
                        # Compilation, caches and first touch of memory belong to no step: one call does not count.
                        policy.predict(copy.deepcopy(seen))
                    before = time.perf_counter_ns()
                    action, state = policy.predict(seen, state, **({} if step else start))
                    after = time.perf_counter_ns()
                    check_finite(action, policy, scenario, together, step)
                    out = arms.step(action)
                    record.keep(step, out, policy.report(state), policy.diagnostics(state))
                    if timed:
                        record.time_ns.append(after - before)
                    if tick is not None and (step + 1) % TICK == 0:
                        tick(TICK * len(together))
            if tick is not None:
                tick(scenario.steps % TICK * len(together))
            played.append(record.episodes())
        episodes += [episode for chain in zip(*played, strict=True) for episode in chain]
    return episodes


def check_finite(
    action: npt.NDArray[Any], policy: Policy, scenario: Scenario, seeds: Sequence[int | Seeds], steps: int
) -> None:
    """Refuses actions that are not finite; the message names policy, scenario, seed and step.

    Args:
        action: Shape (n,) or (B, n).
        policy: The policy that chose them.
        scenario: The scenario.
        seeds: Seeds of the B episodes.
        steps: Steps made before.

    Raises:
        InvalidInputError: An action is not finite.
    """
    if np.isfinite(action).all():
        return
    rows = action.reshape(len(seeds), -1)
    row = int(np.argmin(np.isfinite(rows).all(axis=1)))
    seed = Seeds.of(seeds[row]).seed
    raise InvalidInputError(
        f"{policy.name} in {scenario.name}, seed {seed}, step {steps + 1}: expected finite actions, got "
        f"{rows[row].tolist()}."
    )


@contextlib.contextmanager
def _no_garbage_collection() -> Iterator[None]:
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()
