"""One episode of a policy: the loop that scores are published from, in float64, with the policy timed alone."""

from __future__ import annotations

import dataclasses
import gc
import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from baselines.policy import Operations, SolverPolicy
from ikgym.scenarios import Preview, Scenario
from ikgym.simulator import Simulator, observation
from ikgym.validation import FloatArray

# Steps between two words to the progress bar.
TICK = 100


@dataclasses.dataclass(frozen=True, eq=False)
class Episode:
    """All that happened in an episode; row k is what came of the k-th step, counted from 0.

    Args:
        q: Joint coordinates after the step, in [rad] or [m]. Shape (steps, n).
        qdot: Joint velocities applied, in [rad/s] or [m/s]. Shape (steps, n).
        pose: Task coordinates after the step. Shape (steps, m).
        tracking_cost: Φ^X, 0 where the step does not count. Shape (steps,).
        velocity_cost: Φ^U, 0 where the step does not count. Shape (steps,).
        position_error: In [m]. Shape (steps,).
        orientation_error: Geodesic angle in [rad], NaN where the task has no orientation. Shape (steps,).
        status: Values of :class:`baselines.Status`. Shape (steps,).
        iterations: Iterations of the policy. Shape (steps,).
        time_ns: Wall time of the call of `predict`, in [ns]. Shape (steps,).
        operations: What the steps have cost, see :class:`baselines.policy.Operations`, its arrays of shape (steps,).
        inside: What the policy showed of its inside, by name, see :meth:`SolverPolicy.inside`; each of shape
            (steps, …).
    """

    q: FloatArray
    qdot: FloatArray
    pose: FloatArray
    tracking_cost: FloatArray
    velocity_cost: FloatArray
    position_error: FloatArray
    orientation_error: FloatArray
    status: npt.NDArray[np.int64]
    iterations: npt.NDArray[np.int64]
    time_ns: npt.NDArray[np.int64]
    operations: Operations
    inside: dict[str, FloatArray]


def rollout(
    scenario: Scenario,
    policy: SolverPolicy,
    seed: int,
    *,
    preview: Preview | None = None,
    tick: Callable[[int], object] | None = None,
) -> Episode:
    """Plays one episode.

    The same as `gym.make("RedundantIK-v0", scenario=…)` reset with the seed and stepped with the policy, bit for
    bit, without what Gymnasium's wrappers and Stable-Baselines3's float32 rewards would add.

    Args:
        scenario: What is to be tracked.
        policy: Who tracks it.
        seed: The reset seed.
        preview: What the policy is shown; what it asks for if left out.
        tick: Called now and then, while no clock runs, with the number of steps made since the last call.

    Returns:
        The recorded episode.

    Raises:
        InvalidInputError: The preview is none, or shorter than the policy needs.
    """
    simulator = Simulator(scenario, None, policy.preview if preview is None else preview)
    simulator.reset(np.ones(1, dtype=np.bool_), [seeding.np_random(seed)[0]])
    steps, n, m = scenario.steps, scenario.joints, scenario.task.size
    q, qdot, pose = np.empty((steps, n)), np.empty((steps, n)), np.empty((steps, m))
    tracking, velocity, position, orientation = np.empty((4, steps))
    status, iterations, time_ns = np.empty((3, steps), dtype=np.int64)

    inside: dict[str, FloatArray] = {}

    seen = observation(simulator.observe())
    # Compilation, caches and first touch of memory belong to no step: one call on a copy, whose answer is dropped.
    policy.predict({key: value.copy() for key, value in seen.items()})

    clock = time.perf_counter_ns
    state = None
    collecting = gc.isenabled()
    gc.disable()
    try:
        for k in range(steps):
            begin = clock()
            action, state = policy.predict(seen, state)
            time_ns[k] = clock() - begin
            out = simulator.step(action)
            seen = observation(out)
            report = policy.report(state)
            q[k], qdot[k], pose[k] = out.q[0], out.qdot[0], out.pose[0]
            tracking[k], velocity[k] = out.tracking_cost[0], out.velocity_cost[0]
            position[k], orientation[k] = out.position_error[0], out.orientation_error[0]
            status[k], iterations[k] = report.status[0], report.iterations[0]
            for name, value in policy.inside(state).items():
                inside.setdefault(name, np.empty((steps, *value.shape[1:])))[k] = value[0]
            if tick is not None and (k + 1) % TICK == 0:
                tick(TICK)
    finally:
        if collecting:
            gc.enable()
    if tick is not None:
        tick(steps % TICK)
    operations = policy.operations((status, iterations))
    return Episode(
        q, qdot, pose, tracking, velocity, position, orientation, status, iterations, time_ns, operations, inside
    )
