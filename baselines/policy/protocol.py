"""The policy as the loop that plays episodes needs it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy.typing as npt

from baselines.policy.arguments import Report
from ikgym.scenarios import Preview
from ikgym.validation import FloatArray


class Policy(Protocol):
    """The part of :class:`baselines.SolverPolicy` that the loop needs."""

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
