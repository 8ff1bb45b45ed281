"""N arms as an agent sees them, and as it moves them: what training and validation have in common."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import torch

from baselines.agents.base_policy import Outlook, policy_under
from baselines.agents.features import Features, Processing
from baselines.policy import Batch, Memory, Problem
from ikgym.exceptions import ResetNeededError
from ikgym.scenarios import Preview, Scenario
from ikgym.simulator import Observation
from ikgym.validation import FloatArray


class View:
    """From observations to features, and from answers to actions, with the policy under the agent in between.

    That policy is asked once for each observation, and has its own memory, which is cleared where an episode begins.

    Args:
        processing: Of the agent.
        scenario: What is to be tracked.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The policy cannot be under the agent, see :func:`baselines.agents.base_policy.policy_under`.
    """

    def __init__(self, processing: Processing, scenario: Scenario) -> None:
        self.processing, self.problem = processing, Problem.of(scenario)
        self._under = policy_under(processing, self.problem)
        self._outlook = Outlook.of(processing, self._under)
        self._memory: Memory | None = None
        self._base: FloatArray | None = None
        self._batch: Batch | None = None

    @property
    def preview(self) -> Preview:
        """Which nominal points observations have to show."""
        return self._outlook.preview

    @property
    def size(self) -> int:
        """The number of features, f."""
        return self.processing.size(self.problem)

    @property
    def base(self) -> FloatArray | None:
        """Actions of the policy under the agent for what was last seen, None where there is none. Shape (N, n)."""
        return self._base

    def see(self, observation: Observation, starting: npt.NDArray[np.bool_]) -> Features:
        """The features of what the arms show now.

        Args:
            observation: With a leading axis of N.
            starting: Where an episode begins. Shape (N,).

        Returns:
            Shape (N, f).
        """
        if self._under is not None:
            action, self._memory = self._under.predict(self._shown(observation), self._memory, starting)
            self._base = action.astype(np.float64)
        self._batch = self._seen(observation)
        return self._features(self._batch, self._base)

    def glance(self, observation: Observation, rows: npt.NDArray[np.int64]) -> Features:
        """The features of what some arms show at the end of their episode, where no answer follows.

        Args:
            observation: With a leading axis of R.
            rows: Which arms they are. Shape (R,).

        Returns:
            Shape (R, f).
        """
        base = None
        if self._under is not None and self._memory is not None:
            memory = tuple(array[rows] for array in self._memory)
            action, _ = self._under.predict(self._shown(observation), memory)
            base = action.astype(np.float64)
        return self._features(self._seen(observation), base)

    def act(self, answer: npt.NDArray[Any]) -> FloatArray:
        """What answers to the features last seen mean, as fractions of the velocity limit.

        Args:
            answer: Shape (N, n).

        Raises:
            ResetNeededError: Nothing has been seen yet.
        """
        if self._batch is None:
            raise ResetNeededError("Answers need something that was seen: call reset() first.")
        return self.processing.action(self.problem, self._batch, answer, self._base)

    def _features(self, batch: Batch, base: FloatArray | None) -> Features:
        features = self.processing.features(self.problem, batch, base)
        # In memory of PyTorch, which is aligned: what a matrix product rounds to may depend on where its operands lie,
        # and a run must give the same each time.
        out: Features = torch.empty(features.shape).numpy()
        out[:] = features
        return out

    def _seen(self, observation: Observation) -> Batch:
        """What the agent sees."""
        batch = Batch(*[observation[key] for key in Batch._fields])
        return batch._replace(nominal=self._outlook.of_agent(batch.nominal))

    def _shown(self, observation: Observation) -> Observation:
        """What the policy under it sees."""
        return {**observation, "nominal": self._outlook.of_policy(observation["nominal"])}
