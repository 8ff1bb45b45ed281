"""Plays episodes and records them: the one loop behind evaluation, oracle, training, viewer and papers."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from baselines.policy.protocol import Policy
from baselines.recording import Episode, Seeds
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.outcome import observation
from ikgym.kernels.simulation import Outcome
from ikgym.scenarios import Preview, Scenario
from ikgym.simulator import Simulator

#: Steps between two calls of a :data:`Tick`.
TICK = 100

#: Chooses the actions of one step from the outcome of the step before. Shape (B, n), or (n,) for a single arm.
Act = Callable[[Outcome], npt.NDArray[Any]]

#: Reports progress: called between timed calls, with the number of steps since the last call.
Tick = Callable[[int], object]


def play(
    scenario: Scenario,
    seeds: Sequence[int | Seeds],
    act: Act,
    *,
    preview: Preview,
    single: bool = False,
    commands: int = 0,
) -> Iterator[Outcome]:
    """Plays episodes in lockstep, from reset to end.

    Args:
        scenario: The scenario.
        seeds: Seeds of the episodes, one an arm.
        act: Chooses the actions of all arms; called before each step.
        preview: Steps ahead that the reference trajectory is shown, or which ones.
        single: Whether there is one arm, and its actions have no batch axis.
        commands: Number of past commands that are shown.

    Yields:
        The outcome of each step, arrays with a leading axis of arms. The next step does not change them.

    Raises:
        InvalidInputError: The preview or the number of commands is invalid, or the plant draws no arm by seed.
    """
    rows = len(seeds)
    drawn = [Seeds.of(seed) for seed in seeds]
    simulator = Simulator(scenario, None if single else rows, preview, commands=commands)
    simulator.reset(
        np.ones(rows, dtype=np.bool_),
        [seeding.np_random(one.seed)[0] for one in drawn],
        noise_seeds=[one.noise_seed for one in drawn],
        **simulator.checked({"arm_seed": [one.arm_seed for one in drawn]}),
    )
    out = simulator.observe()
    for _ in range(scenario.steps):
        out = simulator.step(act(out))
        yield out


def rollout(
    scenario: Scenario,
    policy: Policy,
    seed: int | Seeds,
    *,
    preview: Preview | None = None,
    timed: bool = True,
    tick: Tick | None = None,
) -> Episode:
    """Plays one episode.

    Bit-identical to `gym.make("RedundantIK-v0", scenario=…)`, reset with the seed and stepped with the policy; without
    Gymnasium's wrappers and the float32 rewards of Stable-Baselines3.

    Args:
        scenario: The scenario.
        policy: The policy.
        seed: The reset seed, or all seeds of the episode.
        preview: Steps ahead that the policy is shown; its own if left out.
        timed: Whether the calls are timed.
        tick: Reports progress.

    Raises:
        InvalidInputError: The preview is invalid or shorter than the policy needs; an action is not finite or has a
            wrong shape.
    """
    return rollouts(scenario, policy, [seed], preview=preview, timed=timed, tick=tick)[0]


def rollouts(
    scenario: Scenario,
    policy: Policy,
    seeds: Sequence[int | Seeds],
    *,
    preview: Preview | None = None,
    timed: bool = False,
    tick: Tick | None = None,
) -> list[Episode]:
    """Plays several episodes, with one call of the policy for all of them in each step where that is possible.

    The arguments are those of :func:`rollout`. Timed, or with a policy that takes no batch, it plays one episode after
    the other. Progress counts the steps of all episodes.

    Returns:
        The same for each seed as :func:`rollout` gives, bit for bit.

    Raises:
        InvalidInputError: See :func:`rollout`.
    """
    chains = [[seed] for seed in seeds]
    return [episode for (episode,) in sequences(scenario, policy, chains, preview=preview, timed=timed, tick=tick)]


def sequences(
    scenario: Scenario,
    policy: Policy,
    chains: Sequence[Sequence[int | Seeds]],
    *,
    preview: Preview | None = None,
    timed: bool = False,
    tick: Tick | None = None,
) -> list[list[Episode]]:
    """Plays sequences of episodes; the policy keeps its state from one episode to the next.

    `predict` receives `episode_start` where the next episode begins. So a policy can use in later episodes the
    arm that it has learned; memory that does not survive `episode_start` is cleared.

    Args:
        scenario: The scenario.
        policy: The policy.
        chains: The seeds of each sequence, all of one length.
        preview: As in :func:`rollout`.
        timed: As in :func:`rollouts`.
        tick: As in :func:`rollouts`.

    Returns:
        The episodes of each sequence.

    Raises:
        InvalidInputError: See :func:`rollout`.
    """
    single = timed or not policy.batched
    out: list[list[Episode]] = []
    for group in [[chain] for chain in chains] if single else [chains]:
        played, state = [], None
        for seeds in zip(*group, strict=True):
            episodes, state = _play(scenario, policy, seeds, preview, tick, single=single, timed=timed, state=state)
            played.append(episodes)
        out += [list(episodes) for episodes in zip(*played, strict=True)]
    return out


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


def _play(
    scenario: Scenario,
    policy: Policy,
    seeds: Sequence[int | Seeds],
    preview: Preview | None,
    tick: Tick | None,
    *,
    single: bool,
    timed: bool,
    state: Any,
) -> tuple[list[Episode], Any]:
    """Episodes side by side, and the last state of the policy; `state` is that of the episodes before, or None."""
    rows, steps = len(seeds), scenario.steps
    record: dict[str, npt.NDArray[Any]] = {}
    diagnostics: dict[str, npt.NDArray[Any]] = {}
    time_ns = np.empty(steps if timed else 0, dtype=np.int64)
    clock = time.perf_counter_ns
    # A policy without a state knows that an episode begins.
    start = {} if state is None else {"episode_start": np.ones(rows, dtype=np.bool_)}
    step = 0

    def act(out: Outcome) -> npt.NDArray[Any]:
        nonlocal state
        seen = observation(out, 0 if single else None)
        if step == 0:
            # Compilation, caches and first touch of memory belong to no step: one call on a copy, its answer dropped.
            policy.predict({key: value.copy() for key, value in seen.items()})
        begin = clock()
        action, state = policy.predict(seen, state, **({} if step else start))
        end = clock()
        if timed:
            time_ns[step] = end - begin
        check_finite(action, policy, scenario, seeds, step)
        return action

    def keep(into: dict[str, npt.NDArray[Any]], values: Mapping[str, npt.NDArray[Any]]) -> None:
        for name, value in values.items():
            if name not in into:
                into[name] = np.empty((rows, steps, *value.shape[1:]), dtype=value.dtype)
            into[name][:, step] = value

    collecting = gc.isenabled()
    gc.disable()
    try:
        shown = policy.preview if preview is None else preview
        for out in play(scenario, seeds, act, preview=shown, single=single, commands=policy.commands):
            report = policy.report(state)
            keep(
                record,
                {
                    "q": out.true_q,
                    "qdot": out.qdot,
                    "pose": out.true_pose,
                    "tracking_cost": out.tracking_cost,
                    "velocity_cost": out.velocity_cost,
                    "position_error": out.position_error,
                    "orientation_error": out.orientation_error,
                    "at_limit": out.at_limit,
                    "status": report.status,
                    "iterations": report.iterations,
                },
            )
            if scenario.collides:
                keep(record, {"clearance": out.clearance, "pair": out.pair, "stopped": out.stopped})
            if scenario.proximity is not None:
                keep(record, {"proximity_cost": out.proximity_cost})
            keep(diagnostics, policy.diagnostics(state))
            step += 1
            if tick is not None and step % TICK == 0:
                tick(TICK * rows)
    finally:
        if collecting:
            gc.enable()
    if tick is not None:
        tick(steps % TICK * rows)
    episodes = [
        Episode(
            **{name: values[row] for name, values in record.items()},
            time_ns=time_ns,
            diagnostics={name: values[row] for name, values in diagnostics.items()},
        )
        for row in range(rows)
    ]
    return episodes, state
