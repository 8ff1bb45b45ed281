"""Any policy on drives with a delay and a lag: it moves an arm that has neither, and the real one follows."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Annotated, ClassVar

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Problem, Solution
from baselines.policy_kernels import JERK
from baselines.solvers.adaptive.drives import (
    DELAY,
    Hypotheses,
    PredictedMemory,
    identify_rows,
    lead_rows,
    longest_lead,
    offset_rows,
    start_memory,
)
from baselines.solvers.adaptive.following import Servo, follow_rows, move_rows
from baselines.wrapper import NamedWrapper
from ikgym.exceptions import InvalidInputError
from ikgym.plant.checks import PerJoint, joint_numbers
from ikgym.scenarios.preview import furthest, offsets
from ikgym.validation import Bounds, Flag, FloatArray, per_joint

#: By how much neighbouring lags differ.
RATIO = 1.23
#: Longest delay, and oldest measurement, in steps.
LONGEST = 1000


@dataclasses.dataclass(frozen=True, eq=False)
class Predicted(NamedWrapper):
    """Lets a policy drive an arm without delay and lag, d steps ahead of the real one, which is made to follow it.

    A command takes effect ``delay`` steps late, and the velocity follows it through a lag of first order. The base
    policy therefore is shown the arm as it will be when its command takes effect: joint coordinates and velocities of
    an arm of the model that follows commands at once, within the limits, and the reference that belongs to that
    time, for which more of it has to be shown, see :attr:`preview`. So no delay is in its loop, whatever its gain
    (Smith 1957, with the delay-free part of the loop driven by the model). The pose that it sees is that of the model
    plus the filtered difference of the measured pose.

    The command is the velocity of that arm through the inverse of the lag, within the limits of velocity and
    acceleration, and a small share of the error that is predicted for the time when it takes effect: where the
    simulated drive will be then, corrected by how far the measured arm is from where the simulated one should be now.
    With a wrong delay that feedback alone has the delay in its loop, and its gain is low for that. It rises as evidence
    rules out other delays and lags, up to what is stable if a delay changes by two steps, and up to the Kalman gain
    where white noise of q outweighs the errors of the simulated drives.

    Unknown drives are identified joint by joint from measured joint coordinates and the commands of the policy, see
    :mod:`baselines.solvers.adaptive.drives`; ``delay`` and ``bandwidth`` are the guess that holds until there is
    evidence for others. The memory begins anew with each episode.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the base policy.
        options: Its parameters; those left out have its defaults.
        delay: Delay of commands in steps, fractions included; one number, or one a joint.
        bandwidth: f of the lag in [Hz]; one number, or one a joint; None where there is none.
        identify: Whether delay and bandwidth are a guess that is to be improved.
        longest_delay: The longest delay that can be identified, in steps. At most 1000.
        lowest_bandwidth: The lowest bandwidth that can be identified, in [Hz].
        gain: Smallest share of the predicted error that is corrected in a step. Stable below
            2 sin(π / (2 (2 d + 1))) where d steps are not compensated for: at 0.06 up to 25.
        oldest: The oldest measurements that there may be, in steps, see ``q_age`` and ``pose_age`` of observations;
            older ones are taken to be of that age. At most 1000.
        reserve: Share of the velocity limits that is left for corrections: the base policy has the rest.
        overdrive: How many times faster a command may be than the fastest that the base policy wanted within the last
            second; up to 1 % of the limit always. None for any command within the limits.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: A number is out of its range, or the policy is a reference.
    """

    delay: Annotated[float | tuple[float, ...], joint_numbers] = 7.0
    bandwidth: Annotated[float | tuple[float, ...], joint_numbers] | None = 14.0
    identify: Flag = True
    longest_delay: Annotated[int, Bounds(at_least=0, at_most=LONGEST)] = 12
    lowest_bandwidth: Annotated[float, Bounds(above=0.0)] = 8.0
    gain: Annotated[float, Bounds(above=0.0, at_most=1.0)] = 0.06
    oldest: Annotated[int, Bounds(at_least=0, at_most=LONGEST)] = 0
    reserve: Annotated[float, Bounds(at_least=0.0, below=1.0)] = 0.0
    overdrive: Annotated[float, Bounds(at_least=1.0)] | None = None

    name: ClassVar[str] = "predicted"

    def __post_init__(self) -> None:
        super().__post_init__()
        n, lowest = self.problem.model.joints, self.lowest_bandwidth
        latest = per_joint("delay", self.delay, n).max()
        if self.identify and latest > self.longest_delay:
            raise InvalidInputError(
                f"delay: expected a guess of at most longest_delay = {self.longest_delay} steps, got {latest:g}."
            )
        slowest = np.inf if self.bandwidth is None else per_joint("bandwidth", self.bandwidth, n).min()
        if slowest <= 0.0:
            raise InvalidInputError(f"bandwidth: expected a number above 0 or one a joint, got {slowest:g}.")
        if self.identify and slowest < lowest:
            raise InvalidInputError(
                f"bandwidth: expected a guess of at least lowest_bandwidth = {lowest:g} Hz, got {slowest:g}."
            )

    def inner_problem(self) -> Problem:
        """See :meth:`NamedWrapper.inner_problem`."""
        if self.reserve == 0.0:
            return self.problem
        left, model = 1.0 - self.reserve, self.problem.model
        slower = model.replace(velocity_limit=left * model.velocity_limit)
        return self.problem.replace(model=slower, velocity_limit=left * self.problem.velocity_limit)

    @functools.cached_property
    def preview(self) -> int:
        """That of the base policy, and the longest delay on top."""
        lead = self.longest_delay if self.identify else longest_lead(self._hypotheses.delay)
        return furthest(self.inner.preview) + lead

    def own_memory(self, rows: int) -> PredictedMemory:
        """See :func:`start_memory`."""
        return start_memory(rows, self.problem.task.size, self._hypotheses, self.oldest)

    def recall(self, memory: Memory, qdot: FloatArray, change: FloatArray | None = None) -> Memory:
        """See :meth:`SolverPolicy.recall`; the base policy moves the model, whatever was sent."""
        del qdot, change
        return memory

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        outer, inside = self.split(memory)
        kept = PredictedMemory(*[array.copy() for array in outer])
        off = self._observe(batch, kept)
        shown = self._base_observation(batch, kept)
        model_change = kept.arm_qdot[:, 0] - kept.arm_qdot[:, 1]
        step = self.ask(shown, self.inner.recall(inside, shown.qdot, model_change))
        qdot = np.empty_like(batch.q)
        limits, servo = self._limits
        move_rows(limits, self.problem.dt, step.qdot, kept.arm_q, kept.arm_qdot)
        follow_rows(off, self._hypotheses.lags, servo, tuple(kept), qdot)
        return self.solution(qdot, kept, step)

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """Those of the base policy; ``delay`` in steps and ``time_constant`` of the lag in [s], as assumed, by joint.

        ``doubt`` says by how many steps delays that are not refuted differ from that one at most; inf before the arm
        has moved.
        """
        outer, _ = self.split(self.memory_of(state))
        with np.errstate(divide="ignore"):  # no lag at T = 1
            constants = -self.problem.dt / np.log1p(-1.0 / outer.lag)
        drives = {"delay": outer.delay, "time_constant": constants, "doubt": outer.doubt[..., DELAY]}
        return {**super().diagnostics(state), **drives}

    @functools.cached_property
    def _hypotheses(self) -> Hypotheses:
        n = self.problem.model.joints
        delay, guess = per_joint("delay", self.delay, n), self._lag(self.bandwidth)
        if not self.identify:
            longest = max(self.longest_delay, math.ceil(delay.max()))
            return Hypotheses(False, longest, guess[:, None], delay, guess)
        longest = self._lag(self.lowest_bandwidth)[0]
        lags = np.geomspace(1.0, longest, 1 + math.ceil(math.log(longest) / math.log(RATIO)))
        return Hypotheses(True, self.longest_delay, np.tile(lags, (n, 1)), delay, guess)

    def _lag(self, bandwidth: PerJoint | None) -> FloatArray:
        """T of a bandwidth, in steps. Shape (n,)."""
        n = self.problem.model.joints
        if bandwidth is None:
            return np.ones(n)
        lag: FloatArray = -1.0 / np.expm1(-2.0 * np.pi * self.problem.dt * per_joint("bandwidth", bandwidth, n))
        return lag

    @functools.cached_property
    def _limits(self) -> tuple[FloatArray, tuple[object, ...]]:
        """The limits of the arm, see :attr:`Problem.limits`, and a plain :class:`Servo`."""
        problem, model = self.problem, self.problem.model
        change = np.array(model.acceleration_limit * problem.dt)
        overdrive = math.inf if self.overdrive is None else self.overdrive
        unit, largest = np.array(problem.velocity_limit), np.array(problem.largest_qdot)
        servo = Servo(self.gain, problem.dt, unit, largest, change, problem.limits[JERK].copy(), overdrive)
        return self.inner.problem.limits, tuple(servo)

    def _observe(self, batch: Batch, kept: PredictedMemory) -> FloatArray:
        """Reads the measurements; returns how far the arm is from where the drives should have brought it."""
        share, problem = np.full(len(batch.q), self.gain), self.problem
        if not kept.begun.all():
            fresh = ~kept.begun
            kept.arm_q[fresh], kept.arm_qdot[fresh, :2] = batch.q[fresh, None], batch.qdot[fresh, None]
            share[fresh] = 1.0
        q_age, pose_age = _steps(batch.q_age, len(share)), _steps(batch.pose_age, len(share))
        off = np.empty_like(batch.q)
        identify_rows(batch.q, q_age, tuple(self._hypotheses), tuple(kept))
        if self.identify:
            lead_rows(problem.dt, tuple(kept))
        seen = batch.q, batch.pose, q_age, pose_age
        offset_rows(problem.model.chain, problem.task.kind, share, seen, self._hypotheses.lags, tuple(kept), off)
        return off

    def _base_observation(self, batch: Batch, kept: PredictedMemory) -> Batch:
        """Observations of the base policy: the arm that it moves, as late as its command will be."""
        preview, rows, lead = self.inner.preview, len(batch.q), kept.lead
        q, qdot = kept.arm_q[:, 0].copy(), kept.arm_qdot[:, 0].copy()
        if rows == 1 and isinstance(preview, int):
            nominal = batch.nominal[:, lead[0] : lead[0] + preview]
        else:
            nominal = batch.nominal[np.arange(rows)[:, None], lead[:, None] + np.array(offsets(preview)) - 1]
        remaining = np.maximum(batch.remaining - lead[:, None], 1.0)
        pose = self.problem.poses(q) + kept.offset
        return Batch(q, qdot, pose, nominal, remaining, obstacles=batch.obstacles)


def _steps(age: FloatArray | None, rows: int) -> npt.NDArray[np.int64]:
    """Ages of measurements, in steps. Shape (B,)."""
    return np.zeros(rows, dtype=np.int64) if age is None else age[:, 0].astype(np.int64)
