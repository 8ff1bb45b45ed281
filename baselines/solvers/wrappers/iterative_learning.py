"""Iterative learning: a policy that repeats a motion is shown a reference that makes up for the last errors."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, NamedTuple

import numpy as np

from baselines.policy import Batch, Memory, Solution
from baselines.wrapper import NamedWrapper
from ikgym.exceptions import InvalidInputError
from ikgym.jit import kernel
from ikgym.preview import offsets
from ikgym.validation import BoolArray, FloatArray, IntArray, number, whole_number

# Reference coordinates of the same path agree to this.
SAME = 1e-9


class LearningMemory(NamedTuple):
    """What is remembered; the memory of the inner policy stands behind it.

    Attributes:
        correction: What is added to the reference at the knots, in task coordinates. Shape (B, K, m).
        error: Weighted sums of this episode's errors at the knots. Shape (B, K, m).
        weight: The sums of their weights. Shape (B, K).
        reference: X^N(k), X^N(k-1), … of the last steps. Shape (B, oldest + 1, m).
        begun: How many steps of the episode have been seen. Shape (B,).
        steps: The steps of the episode. Shape (B,).
        first: The reference that the path began with. Shape (B, m).
    """

    correction: FloatArray
    error: FloatArray
    weight: FloatArray
    reference: FloatArray
    begun: IntArray
    steps: IntArray
    first: FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class IterativeLearning(NamedWrapper):
    """Shifts the reference of another policy by what the last episodes on the same path have taught.

    Behind each episode the correction ξ of the reference becomes ξ(t) ← Q [ξ(t) + rate · e(t + lead)] with the
    measured error e = X^N - x (Arimoto 1984, with the phase lead of Wang 2000): whatever repeats itself goes, be it
    the calibration of the arm along this path, a lag or a delay. With a delay of d steps and a lag of T steps, the
    shift of the reference shows in the pose d + T steps later, and learning converges over a wide band only with that
    ``lead``. Errors are averaged and corrections interpolated between knots ``knot_spacing`` steps apart; Q smooths
    them by (1, 2, 1) / 4 over the knots: so measurement noise is not learnt, nor what is too fast for it.

    It makes sense where the same arm makes the same motion again and again: fixed paths with the reset option
    ``arm_seed``, or a plant that is not drawn. On another path, which is told by its first reference, or in
    a scenario of random paths, it starts from 0 and is the inner policy. The inner policy has to be stable: learning
    goes from episode to episode, not into the loop.

    With ``keep`` what is learnt outlasts ``episode_start``, and is cleared by ``state=None``. Without it every episode
    starts from 0, as policies do that are compared on episodes in any order, and nothing comes of it.

    Args:
        problem: What the policy is told of the scenario.
        policy: The name of the inner policy.
        options: Its parameters; those left out have its defaults.
        keep: Whether what is learnt is kept from episode to episode.
        rate: Share of an error that is learnt in an episode.
        lead: By how many steps the pose comes behind the reference.
        knot_spacing: Steps between knots.
        longest: How many steps of a path are learnt; the rest is that of the inner policy.
        oldest: The oldest pose that there may be, in steps, see ``pose_age`` of observations; nothing is learnt from
            older ones.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: A number is out of its range, or the policy is a reference.
    """

    keep: bool = False
    rate: float = 0.7
    lead: int = 0
    knot_spacing: int = 10
    longest: int = 5000
    oldest: int = 0

    name: ClassVar[str] = "iterative_learning"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.keep, (bool, np.bool_)):
            raise InvalidInputError(f"keep: expected True or False, got {self.keep!r}.")
        if number("rate", self.rate, above=0.0) >= 2.0:
            raise InvalidInputError(f"rate: expected a number above 0 and below 2, got {self.rate:g}.")
        for name, least in {"lead": 0, "knot_spacing": 1, "longest": 1, "oldest": 0}.items():
            whole_number(name, getattr(self, name), at_least=least)

    def own_memory(self, rows: int) -> LearningMemory:
        """Nothing learnt."""
        knots, m = self.longest // self.knot_spacing + 2, self.problem.task.size
        return LearningMemory(
            np.zeros((rows, knots, m)),
            np.zeros((rows, knots, m)),
            np.zeros((rows, knots)),
            np.zeros((rows, self.oldest + 1, m)),
            np.zeros(rows, dtype=np.int64),
            np.zeros(rows, dtype=np.int64),
            np.zeros((rows, m)),
        )

    def restarted(self, memory: Memory, rows: BoolArray) -> Memory:
        """Where an episode begins, the errors of the last one are learnt; the inner policy starts anew."""
        if not self.keep:
            return super().restarted(memory, rows)
        own, inside = self.split(memory)
        fresh = self.own_memory(len(rows))
        kept = fresh._replace(correction=learnt(own, self.rate), steps=own.steps, first=own.first)
        chosen = [
            np.where(rows.reshape(-1, *[1] * (old.ndim - 1)), new, old) for new, old in zip(kept, own, strict=True)
        ]
        return *chosen, *(self.inner.restarted(inside, rows) if inside else inside)

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        own, inside = self.split(memory)
        nominal = batch.nominal
        remaining = batch.remaining[:, 0].astype(np.int64)
        steps = np.maximum(own.steps, remaining)
        other = (own.begun == 0) & (steps == remaining) & (np.abs(nominal[:, 0] - own.first) > SAME).any(axis=1)
        correction = np.where(other[:, None, None], 0.0, own.correction)
        steps = np.where(other, remaining, steps)
        done = steps - remaining
        first = np.where((done == 0)[:, None], nominal[:, 0], own.first)

        error, weight = own.error.copy(), own.weight.copy()
        age = np.zeros(len(done), dtype=np.int64) if batch.pose_age is None else batch.pose_age[:, 0].astype(np.int64)
        take_rows(batch.pose, own.reference, (done, own.begun, age), (self.lead, self.knot_spacing), error, weight)
        reference = np.concatenate([nominal[:, :1], own.reference[:, :-1]], axis=1)
        ahead = np.array(offsets(self.inner.preview))
        shown = nominal[:, : len(ahead)].copy()
        shift_rows(correction, done, ahead, self.knot_spacing, shown)
        step = self.ask(batch._replace(nominal=shown), inside)
        kept = LearningMemory(correction, error, weight, reference, own.begun + 1, steps, first)
        return self.solution(step.action * self.problem.velocity_limit, kept, step)


def learnt(memory: LearningMemory, rate: float) -> FloatArray:
    """The correction behind an episode: ξ and a share of the mean error at each knot, smoothed. Shape (B, K, m).

    Knots about which the episode says nothing, such as those behind its end, stay as they are, but for the smoothing.
    """
    known = memory.weight > 0.0
    mean = memory.error / np.where(known, memory.weight, 1.0)[..., None]
    raw = memory.correction + rate * np.where(known[..., None], mean, 0.0)
    padded = np.pad(raw, ((0, 0), (1, 1), (0, 0)), mode="edge")
    smooth: FloatArray = 0.25 * padded[:, :-2] + 0.5 * raw + 0.25 * padded[:, 2:]
    return smooth


@kernel
def take_rows(pose, reference, times, grid, error, weight):
    """Adds the present error to those of the two knots around the time when the reference would have to be shifted.

    Args:
        pose: Measured task coordinates. Shape (B, m).
        reference: X^N(k) and those before. Shape (B, oldest + 1, m).
        times: k; how many steps of the episode have been seen; how old the pose is. Shapes (B,).
        grid: The lead, and the steps between knots.
        error: Weighted sums, changed in place. Shape (B, K, m).
        weight: Sums of weights, changed in place. Shape (B, K).
    """
    (done, seen, age), (lead, spacing) = times, grid
    for row in range(pose.shape[0]):
        time = done[row] - age[row] - lead
        if time < 0 or age[row] >= min(reference.shape[1], seen[row]) or time // spacing + 1 >= weight.shape[1]:
            continue
        i, share = time // spacing, (time % spacing) / spacing
        for j in range(pose.shape[1]):
            missing = reference[row, age[row], j] - pose[row, j]
            error[row, i, j] += (1.0 - share) * missing
            error[row, i + 1, j] += share * missing
        weight[row, i] += 1.0 - share
        weight[row, i + 1] += share


@kernel
def shift_rows(correction, done, ahead, spacing, nominal):
    """Adds corrections (B, K, m) to references (B, p, m) at the steps done (B,) and ahead (p,)."""
    for row in range(nominal.shape[0]):
        for p in range(ahead.shape[0]):
            time = done[row] + ahead[p]
            i, share = time // spacing, (time % spacing) / spacing
            if i + 1 < correction.shape[1]:
                for j in range(nominal.shape[2]):
                    nominal[row, p, j] += (1.0 - share) * correction[row, i, j] + share * correction[row, i + 1, j]
