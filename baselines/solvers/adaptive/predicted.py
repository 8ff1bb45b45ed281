"""Any policy on drives with a delay and a lag: it moves an arm that has neither, and the real one follows."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Problem, Solution
from baselines.policy.parameters import parameter
from baselines.solvers.adaptive.drives import (
    Hypotheses,
    PredictedMemory,
    evidence_rows,
    identify_rows,
    offset_rows,
    past_rows,
    start_memory,
)
from baselines.solvers.adaptive.following import Servo, follow_rows, move_rows
from baselines.solvers.quadratic_program.limits import limits_with_braking
from baselines.wrapper import NamedWrapper
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios.preview import furthest, offsets
from ikgym.validation import FloatArray, flag, number, whole_number

#: By how much neighbouring lags differ.
RATIO = 1.23


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
    With a wrong delay that feedback alone has the delay in its loop, and its gain is low for that.

    Unknown drives are identified from measured joint coordinates and the policy's own commands, see
    :mod:`baselines.solvers.adaptive.drives`; ``delay`` and ``bandwidth`` are the guess that holds until there is
    evidence for others. The memory begins anew with each episode.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the base policy.
        options: Its parameters; those left out have its defaults.
        delay: Delay of commands in steps.
        bandwidth: f of the lag in [Hz]; None where there is none.
        identify: Whether delay and bandwidth are a guess that is to be improved.
        longest_delay: The longest delay that can be identified, in steps.
        lowest_bandwidth: The lowest bandwidth that can be identified, in [Hz].
        gain: Share of the predicted error that is taken back in a step. Stable below 2 sin(π / (2 (2 d + 1))) where d
            steps are not compensated for: at 0.06 up to 25.
        oldest: The oldest measurements that there may be, in steps, see ``q_age`` and ``pose_age`` of observations;
            older ones are taken to be of that age.
        reserve: Share of the velocity limits that is left for corrections: the base policy has the rest.
        overdrive: How many times faster a command may be than the fastest that the base policy wanted within the last
            second; up to 1 % of the limit always. None for any command within the limits.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: A number is out of its range, or the policy is a reference.
    """

    delay: int = parameter(7, whole_number, at_least=0)
    bandwidth: float | None = parameter(14.0, number, above=0.0)
    identify: bool = parameter(True, flag)
    longest_delay: int = parameter(12, whole_number, at_least=0)
    lowest_bandwidth: float = parameter(8.0, number, above=0.0)
    gain: float = parameter(0.06, number, above=0.0, at_most=1.0)
    oldest: int = parameter(0, whole_number, at_least=0)
    reserve: float = parameter(0.0, number, at_least=0.0, below=1.0)
    overdrive: float | None = parameter(None, number, at_least=1.0)

    name: ClassVar[str] = "predicted"

    def __post_init__(self) -> None:
        super().__post_init__()
        lowest = self.lowest_bandwidth
        if self.identify and self.delay > self.longest_delay:
            raise InvalidInputError(
                f"delay: expected a guess of at most longest_delay = {self.longest_delay} steps, got {self.delay}."
            )
        if self.identify and self.bandwidth is not None and self.bandwidth < lowest:
            raise InvalidInputError(
                f"bandwidth: expected a guess of at least lowest_bandwidth = {lowest:g} Hz, got {self.bandwidth:g}."
            )

    def inner_problem(self) -> Problem:
        """See :meth:`NamedWrapper.inner_problem`."""
        if self.reserve == 0.0:
            return self.problem
        left, model = 1.0 - self.reserve, self.problem.model
        slower = model.replace(velocity_limit=left * model.velocity_limit)
        return self.problem.replace(model=slower, velocity_limit=left * self.problem.velocity_limit)

    @property
    def preview(self) -> int:
        """That of the base policy, and the longest delay on top."""
        return furthest(self.inner.preview) + int(self._hypotheses.delays[-1])

    def own_memory(self, rows: int) -> PredictedMemory:
        """See :func:`start_memory`."""
        history = int(self._hypotheses.delays[-1]) + self.oldest + 2
        return start_memory(rows, (self.problem.model.joints, self.problem.task.size), self._hypotheses, history)

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        own, inside = self.split(memory)
        kept = PredictedMemory(*[array.copy() for array in own])
        off = self._observe(batch, kept)
        shown = self._shown(batch, kept)
        step = self.ask(shown, self.inner.recall(inside, shown.qdot))
        behind = kept.arm_q - self._past(np.zeros_like(kept.delay), kept) - off
        qdot = np.empty_like(batch.q)
        limits, servo = self._limits
        move_rows(limits, self.problem.dt, step.qdot, kept.arm_q, kept.arm_qdot)
        follow_rows(behind, kept.arm_qdot, self._hypotheses.lags, servo, tuple(kept), qdot)
        return self.solution(qdot, kept, step)

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """Those of the base policy; ``delay`` in steps and ``time_constant`` of the lag in [s], as assumed.

        ``evidence`` is the logarithm of the likelihood ratio between that delay and the next best one.
        """
        own, _ = self.split(self.memory_of(state))
        with np.errstate(divide="ignore"):  # no lag at T = 1
            constants = -self.problem.dt / np.log1p(-1.0 / own.lag)
        evidence = np.empty(len(own.lag))
        evidence_rows(self._hypotheses.lags, tuple(own), evidence)
        told = {"delay": own.delay.astype(np.float64), "time_constant": constants, "evidence": evidence}
        return {**super().diagnostics(state), **told}

    @functools.cached_property
    def _hypotheses(self) -> Hypotheses:
        guess = self._lag(self.bandwidth)
        if not self.identify:
            return Hypotheses(np.array([self.delay]), np.array([guess]), self.delay, guess)
        longest = self._lag(self.lowest_bandwidth)
        lags = np.geomspace(1.0, longest, 1 + math.ceil(math.log(longest) / math.log(RATIO)))
        return Hypotheses(np.arange(self.longest_delay + 1), lags, self.delay, guess)

    def _lag(self, bandwidth: float | None) -> float:
        """T of a bandwidth, in steps."""
        return 1.0 if bandwidth is None else -1.0 / math.expm1(-2.0 * math.pi * bandwidth * self.problem.dt)

    @functools.cached_property
    def _limits(self) -> tuple[FloatArray, tuple[object, ...]]:
        """The limits of the arm, see :func:`limits_with_braking`, and a plain :class:`Servo`."""
        problem, model = self.problem, self.problem.model
        change = np.array(model.acceleration_limit * problem.dt)
        overdrive = math.inf if self.overdrive is None else self.overdrive
        unit, largest = np.array(problem.velocity_limit), np.array(problem.largest_qdot)
        servo = Servo(self.gain, problem.dt, unit, largest, change, overdrive)
        return limits_with_braking(self.inner.problem), tuple(servo)

    def _observe(self, batch: Batch, kept: PredictedMemory) -> FloatArray:
        """Takes in the measurements, and tells how far the arm is from where the drives should have brought it."""
        share, problem = np.full(len(batch.q), self.gain), self.problem
        if not kept.begun.all():
            fresh = ~kept.begun
            kept.arm_q[fresh], kept.arm_qdot[fresh], share[fresh] = batch.q[fresh], batch.qdot[fresh], 1.0
        q_age, pose_age = _steps(batch.q_age, len(share)), _steps(batch.pose_age, len(share))
        before, off = kept.delay.copy(), np.empty_like(batch.q)
        identify_rows(batch.q, q_age, tuple(self._hypotheses), tuple(kept))
        seen = batch.q, batch.pose, q_age, pose_age
        model = problem.model.chain, problem.task.kind, problem.dt
        offset_rows(*model, share, before, seen, self._hypotheses.lags, tuple(kept), off)
        return off

    def _shown(self, batch: Batch, kept: PredictedMemory) -> Batch:
        """Observations of the base policy: the arm that it moves, as late as its command will be."""
        preview, rows, delay = self.inner.preview, len(batch.q), kept.delay
        if rows == 1 and isinstance(preview, int):
            nominal = batch.nominal[:, delay[0] : delay[0] + preview]
        else:
            nominal = batch.nominal[np.arange(rows)[:, None], delay[:, None] + np.array(offsets(preview)) - 1]
        remaining = np.maximum(batch.remaining - delay[:, None], 1.0)
        pose = self.problem.poses(kept.arm_q) + kept.offset
        parts = kept.arm_q.copy(), kept.arm_qdot.copy(), pose, nominal, remaining
        return Batch(*parts, obstacles=batch.obstacles)

    def _past(self, steps: npt.NDArray[np.int64], kept: PredictedMemory) -> FloatArray:
        """Predicted joint coordinates of the arms, see :func:`past_rows`."""
        out = np.empty_like(kept.sent)
        past_rows(steps, self._hypotheses.lags, tuple(kept), out)
        return out


def _steps(age: FloatArray | None, rows: int) -> npt.NDArray[np.int64]:
    """Ages of measurements, in steps. Shape (B,)."""
    return np.zeros(rows, dtype=np.int64) if age is None else age[:, 0].astype(np.int64)
