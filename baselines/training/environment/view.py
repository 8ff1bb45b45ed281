"""N arms as an agent sees them, and as it moves them: what training and validation have in common."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import torch

from baselines.agents.features import Features
from baselines.agents.protocols import Transform
from baselines.agents.view import AgentView, Seen
from baselines.policy import Batch, Memory, Problem
from ikgym.exceptions import ResetNeededError
from ikgym.outcome import OBSERVED
from ikgym.scenarios import Preview, Scenario
from ikgym.simulator import Observation
from ikgym.validation import FloatArray


class View:
    """From observations to features, and from network outputs to actions: :class:`AgentView` with a memory.

    The base policy is asked once for each observation. Its memory is cleared where an episode begins.

    Args:
        processing: Of the agent.
        scenario: What is to be tracked.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The base policy is refused, see :func:`baselines.agents.base_policy.make_base_policy`.
    """

    def __init__(self, processing: Transform, scenario: Scenario) -> None:
        self.processing, self.problem = processing, Problem.of(scenario)
        self._view = AgentView.of(processing, self.problem)
        self._memory: Memory | None = None
        self._seen: Seen | None = None

    @property
    def preview(self) -> Preview:
        """Which nominal points observations have to show."""
        return self._view.preview.shown

    @property
    def size(self) -> int:
        """The number of features, f."""
        return self.processing.size(self.problem)

    @property
    def base(self) -> FloatArray | None:
        """Actions of the base policy for what was last seen, None where there is none. Shape (N, n)."""
        return None if self._seen is None else self._seen.base

    @property
    def batch(self) -> Batch:
        """What was last seen, with the nominal coordinates at the offsets of the agent.

        Raises:
            ResetNeededError: Nothing has been seen yet.
        """
        return self._last().batch

    def see(self, observation: Observation, starting: npt.NDArray[np.bool_]) -> Features:
        """The features of what the arms show now.

        Args:
            observation: With a leading axis of N.
            starting: Where an episode begins. Shape (N,).

        Returns:
            Shape (N, f).
        """
        self._seen = self._view.see(_batch(observation), self._recall(starting))
        self._memory = () if self._seen.step is None else self._seen.step.memory
        return aligned(self._seen.features)

    def glance(self, observation: Observation, rows: npt.NDArray[np.int64]) -> Features:
        """The features of what some arms show at the end of their episode, where no action follows.

        Args:
            observation: With a leading axis of R.
            rows: Which arms they are. Shape (R,).

        Returns:
            Shape (R, f).
        """
        memory = tuple(array[rows] for array in self._memory or ())
        return aligned(self._view.see(_batch(observation), memory).features)

    def act(self, output: npt.NDArray[Any]) -> FloatArray:
        """What network outputs for the features last seen mean, as fractions of the velocity limit.

        Args:
            output: Shape (N, n).

        Raises:
            ResetNeededError: Nothing has been seen yet.
        """
        return self._view.action(self._last(), output)

    def _last(self) -> Seen:
        if self._seen is None:
            raise ResetNeededError("Actions need something that was seen: call reset() first.")
        return self._seen

    def _recall(self, starting: npt.NDArray[np.bool_]) -> Memory:
        """The memory of the base policy, cleared where an episode begins."""
        base = self._view.base
        if base is None:
            return ()
        if self._memory is None:
            return base.memory(len(starting))
        return base.restarted(self._memory, starting) if starting.any() else self._memory


def _batch(observation: Observation) -> Batch:
    return Batch(*[np.ascontiguousarray(observation[key], dtype=np.float64) for key in OBSERVED])


def aligned(features: Features) -> Features:
    """The same numbers in memory of PyTorch, which is aligned.

    What a matrix product rounds to may depend on where its operands lie, and a run must give the same each time.
    """
    out: Features = torch.empty(features.shape).numpy()
    out[:] = features
    return out
