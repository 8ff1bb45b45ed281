"""Plays episodes and records them: the one loop behind evaluation, leaderboard, oracle, training, viewer and papers."""

from __future__ import annotations

import dataclasses
import gc
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from baselines.policy import Report
from ikgym.exceptions import InvalidInputError
from ikgym.outcome import Observation, observation
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


# Steps between two words to the progress bar.
TICK = 100

#: Called now and then, while no clock runs, with the number of steps made since the last call.
Tick = Callable[[int], object]


class Player(Protocol):
    """What the loop asks of a policy: a :class:`baselines.SolverPolicy`, or what stands for one."""

    @property
    def name(self) -> str:
        """What messages call it."""

    @property
    def preview(self) -> Preview:
        """Steps ahead that it asks for, or which ones."""

    @property
    def commands(self) -> int:
        """How many of the last commands it asks for."""

    def predict(self, observation: Any, state: Any = None, episode_start: Any = None) -> tuple[npt.NDArray[Any], Any]:
        """Actions, and the state for the next call, which is never None."""

    def report(self, state: Any) -> Report:
        """Status and iterations of the call that returned a state."""

    def diagnostics(self, state: Any) -> dict[str, FloatArray]:
        """What it shows of how it came to its action."""


@dataclasses.dataclass(frozen=True, eq=False)
class Episode:
    """All that happened in an episode; row k is what came of the k-th step, counted from 0.

    Args:
        q: Joint coordinates after the step, in [rad] or [m], whatever was measured. Shape (steps, n).
        qdot: Joint velocities applied, in [rad/s] or [m/s]. Shape (steps, n).
        pose: Task coordinates after the step, whatever was measured. Shape (steps, m).
        tracking_cost: Φ^X, 0 where the step does not count. Shape (steps,).
        velocity_cost: Φ^U, 0 where the step does not count. Shape (steps,).
        position_error: In [m]. Shape (steps,).
        orientation_error: Geodesic angle in [rad], NaN where the task has no orientation. Shape (steps,).
        at_limit: Joints held back by a stop, by the velocity and by the acceleration limit. Shape (steps, 3).
        status: Values of :class:`baselines.Status`. Shape (steps,).
        iterations: Iterations of the policy. Shape (steps,).
        time_ns: Wall time of the call of `predict`, in [ns]. Shape (steps,), or (0,) where the calls were not timed.
        diagnostics: What the policy showed of how it came to its action, by name, see
            :meth:`SolverPolicy.diagnostics`; each of shape (steps, …).
    """

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


def rollout(
    scenario: Scenario,
    policy: Player,
    seed: int | Draw,
    *,
    preview: Preview | None = None,
    timed: bool = True,
    tick: Tick | None = None,
) -> Episode:
    """Plays one episode by single calls of the policy, each of them timed.

    The same as `gym.make("RedundantIK-v0", scenario=…)` reset with the seed and stepped with the policy, bit for
    bit, without what Gymnasium's wrappers and Stable-Baselines3's float32 rewards would add.

    Args:
        scenario: What is to be tracked.
        policy: Who tracks it.
        seed: The reset seed, or what is drawn how.
        preview: What the policy is shown; what it asks for if left out.
        timed: Whether the times of the calls are kept.
        tick: See :data:`Tick`.

    Returns:
        The recorded episode.

    Raises:
        InvalidInputError: The preview is none, or shorter than the policy needs; an action is refused.
    """
    (episode,), _ = _play(scenario, policy, [seed], preview, tick, alone=True, timed=timed)
    return episode


def rollouts(
    scenario: Scenario,
    policy: Player,
    seeds: Sequence[int | Draw],
    *,
    preview: Preview | None = None,
    tick: Tick | None = None,
) -> list[Episode]:
    """Plays several episodes in step, with one call of the policy for all of them.

    Args:
        scenario: What is to be tracked.
        policy: Who tracks it.
        seeds: The reset seeds, or what is drawn how.
        preview: What the policy is shown; what it asks for if left out.
        tick: See :data:`Tick`; the steps of all episodes count.

    Returns:
        For each seed what :func:`rollout` gives, bit for bit, but no times.

    Raises:
        InvalidInputError: The preview is none, or shorter than the policy needs; an action is refused.
    """
    return _play(scenario, policy, seeds, preview, tick, alone=False, timed=False)[0]


def sequence(
    scenario: Scenario,
    policy: Player,
    episodes: Sequence[Sequence[Draw]],
    *,
    preview: Preview | None = None,
    alone: bool = False,
    timed: bool = False,
    tick: Tick | None = None,
) -> Iterator[list[Episode]]:
    """Plays episodes one after the other, and hands the policy's state on; it is told where an episode begins.

    What a policy has learned of its arm can so be of use in the next episode; what does not survive `episode_start` is
    cleared there.

    Args:
        scenario: What is to be tracked.
        policy: Who tracks it.
        episodes: What is drawn how, of arms side by side, in each episode.
        preview: What the policy is shown; what it asks for if left out.
        alone: Whether there is one arm, and the policy is called without an axis of arms.
        timed: Whether the times of the calls are kept.
        tick: See :data:`Tick`.

    Yields:
        What :func:`rollouts` gives of each episode.

    Raises:
        InvalidInputError: As in :func:`rollouts`.
    """
    state: Any = None
    for draws in episodes:
        played, state = _play(scenario, policy, draws, preview, tick, alone=alone, timed=timed, state=state)
        yield played


def finite(
    action: npt.NDArray[Any], policy: Player, scenario: Scenario, seeds: Sequence[int | Draw], steps: int
) -> None:
    """Refuses actions that are not finite, and says whose they are.

    Args:
        action: Of shape (n,), or (B, n).
        policy: Who chose them.
        scenario: What is tracked.
        seeds: The reset seeds of the B arms, or what is drawn how.
        steps: Steps made before.

    Raises:
        InvalidInputError: An action is not finite.
    """
    if np.isfinite(action).all():
        return
    rows = action.reshape(len(seeds), -1)
    row = int(np.argmin(np.isfinite(rows).all(axis=1)))
    seed = Draw.of(seeds[row]).seed
    raise InvalidInputError(
        f"{policy.name} in {scenario.name}, seed {seed}, step {steps + 1}: expected finite actions, got "
        f"{rows[row].tolist()}."
    )


def _play(
    scenario: Scenario,
    policy: Player,
    seeds: Sequence[int | Draw],
    preview: Preview | None,
    tick: Tick | None,
    *,
    alone: bool,
    timed: bool,
    state: Any = None,
) -> tuple[list[Episode], Any]:
    """The episodes, and the state behind them; one that is given is that of the episodes before."""
    rows, steps, n, m = len(seeds), scenario.steps, scenario.joints, scenario.task.size
    shown = policy.preview if preview is None else preview
    q, qdot, pose = np.empty((rows, steps, n)), np.empty((rows, steps, n)), np.empty((rows, steps, m))
    tracking, velocity, position, orientation = np.empty((4, rows, steps))
    at_limit = np.empty((rows, steps, 3))
    status, iterations = np.empty((2, rows, steps), dtype=np.int64)
    time_ns = np.empty(steps if timed else 0, dtype=np.int64)
    diagnostics: dict[str, FloatArray] = {}

    clock = time.perf_counter_ns
    # A policy without a state knows that an episode begins.
    begins = None if state is None else np.ones(rows, dtype=np.bool_)
    made = 0

    def act(out: Outcome) -> npt.NDArray[Any]:
        nonlocal state
        seen = _seen(out, alone)
        if made == 0:
            # Compilation, caches and first touch of memory belong to no step: one call on a copy, its answer dropped.
            policy.predict({key: value.copy() for key, value in seen.items()})
        begin = clock()
        told = {} if begins is None or made else {"episode_start": begins}
        action, state = policy.predict(seen, state, **told)
        end = clock()
        if timed:
            time_ns[made] = end - begin
        finite(action, policy, scenario, seeds, made)
        return action

    collecting = gc.isenabled()
    gc.disable()
    try:
        for k, out in enumerate(play(scenario, seeds, act, preview=shown, single=alone, commands=policy.commands)):
            report = policy.report(state)
            q[:, k], qdot[:, k], pose[:, k] = out.true_q, out.qdot, out.true_pose
            tracking[:, k], velocity[:, k] = out.tracking_cost, out.velocity_cost
            position[:, k], orientation[:, k] = out.position_error, out.orientation_error
            at_limit[:, k] = out.at_limit
            status[:, k], iterations[:, k] = report.status, report.iterations
            for name, value in policy.diagnostics(state).items():
                diagnostics.setdefault(name, np.empty((rows, steps, *value.shape[1:])))[:, k] = value
            if tick is not None and (k + 1) % TICK == 0:
                tick(TICK * rows)
            made = k + 1
    finally:
        if collecting:
            gc.enable()
    if tick is not None:
        tick(steps % TICK * rows)
    episodes = [
        Episode(
            q[row],
            qdot[row],
            pose[row],
            tracking[row],
            velocity[row],
            position[row],
            orientation[row],
            at_limit[row],
            status[row],
            iterations[row],
            time_ns,
            {name: values[row] for name, values in diagnostics.items()},
        )
        for row in range(rows)
    ]
    return episodes, state


def _seen(out: Outcome, alone: bool) -> Observation:
    """What the policy sees: of the only arm, or with an axis of arms."""
    return observation(out, 0 if alone else None)
