"""The policy under an agent: the one whose actions it corrects, and what both are shown."""

from __future__ import annotations

import contextlib
import contextvars
import dataclasses
from collections.abc import Iterator
from typing import Self

import numpy as np

from baselines import registry
from baselines.agents.parts import Sees
from baselines.policy import Problem, SolverPolicy
from baselines.spec import parse_policy
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview
from ikgym.scenarios.scenario import furthest
from ikgym.validation import FloatArray

#: Whether a policy is being made that a file has named.
_naming = contextvars.ContextVar("naming", default=False)


def policy_under(processing: Sees, problem: Problem) -> SolverPolicy | None:
    """The policy under an agent, None where it stands alone.

    Args:
        processing: Of the agent.
        problem: What both are told of the scenario.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The policy is a reference, or an agent or made from one, or does not suit the scenario.
    """
    if processing.base_policy is None:
        return None
    name, parameters = parse_policy(processing.base_policy)
    kind = registry.get(name)
    if kind.reference:
        raise InvalidInputError(
            f"base_policy: expected a policy that acts on what it sees, got the reference {name!r}."
        )
    with _named_by_a_file():
        return kind(problem, **parameters)


def refuse_to_be_named() -> None:
    """Insists that no file has named the policy that is being made: one file must not make another be read.

    Raises:
        InvalidInputError: A file has.
    """
    if _naming.get():
        raise InvalidInputError("base_policy: expected a policy that is no agent and is not made from one.")


@contextlib.contextmanager
def _named_by_a_file() -> Iterator[None]:
    token = _naming.set(True)
    try:
        yield
    finally:
        _naming.reset(token)


@dataclasses.dataclass(frozen=True)
class Outlook:
    """Which nominal points an agent and the policy under it are shown, and where each finds its own.

    Args:
        own: Steps ahead at which the agent sees them.
        under: How many steps ahead the policy under it sees, from 1 on.
    """

    own: tuple[int, ...]
    under: int

    @classmethod
    def of(cls, processing: Sees, under: SolverPolicy | None) -> Self:
        """That of an agent."""
        return cls(processing.offsets, 0 if under is None else furthest(under.preview))

    @property
    def preview(self) -> Preview:
        """What has to be shown: the agent's own steps where those of the policy under it are among them, or all."""
        if self.own[: self.under] == tuple(range(1, self.under + 1)):
            return self.own
        return self.furthest

    @property
    def furthest(self) -> int:
        """The furthest step that either sees."""
        return max(self.own[-1], self.under)

    def of_agent(self, nominal: FloatArray) -> FloatArray:
        """What the agent sees of what is shown. Shapes (B, p, m)."""
        if nominal.shape[1] == len(self.own):
            return nominal
        return nominal.take(np.array(self.own) - 1, axis=1)

    def of_policy(self, nominal: FloatArray) -> FloatArray:
        """What the policy under it sees of what is shown. Shapes (B, p, m)."""
        return np.ascontiguousarray(nominal[:, : self.under])
