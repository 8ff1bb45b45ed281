"""The base policy of an agent: the one whose actions it corrects, and what both are shown."""

from __future__ import annotations

import dataclasses
from typing import Self

import numpy as np

from baselines import registry
from baselines.agents.protocols import Transform
from baselines.policy import Problem, SolverPolicy
from baselines.spec import parse_policy
from baselines.wrapper import policies_in
from ikgym.exceptions import InvalidInputError
from ikgym.preview import furthest
from ikgym.scenarios import Preview
from ikgym.validation import FloatArray


def check_base_policy(spec: str | None) -> None:
    """Refuses a base policy that is read from a file: one file must not make another be read, nor trust it.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: It is an agent, or made from one.
    """
    if spec is not None and any(kind.from_file for kind in policies_in(spec)):
        raise InvalidInputError(
            f"base_policy: expected a policy that is no agent and is not made from one, got {spec}."
        )


def make_base_policy(processing: Transform, problem: Problem) -> SolverPolicy | None:
    """The base policy of an agent, None where it stands alone.

    Args:
        processing: Of the agent.
        problem: What both are told of the scenario.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The policy is a reference, or an agent or made from one, or does not suit the scenario.
    """
    if processing.base_policy is None:
        return None
    check_base_policy(processing.base_policy)
    name, parameters = parse_policy(processing.base_policy)
    kind = registry.get(name)
    if kind.reference:
        raise InvalidInputError(
            f"base_policy: expected a policy that acts on what it sees, got the reference {name!r}."
        )
    return kind(problem, **parameters)


@dataclasses.dataclass(frozen=True)
class SharedPreview:
    """Which nominal points an agent and its base policy are shown, and where each finds its own.

    Args:
        agent: Steps ahead at which the agent sees them.
        base: How many steps ahead the base policy sees, from 1 on; 0 where there is none.
    """

    agent: tuple[int, ...]
    base: int

    @classmethod
    def of(cls, processing: Transform, base: SolverPolicy | None) -> Self:
        """That of an agent."""
        return cls(processing.offsets, 0 if base is None else furthest(base.preview))

    @property
    def shown(self) -> Preview:
        """What has to be shown: the agent's own steps where those of the base policy are among them, or all."""
        if self.agent[: self.base] == tuple(range(1, self.base + 1)):
            return self.agent
        return self.furthest

    @property
    def furthest(self) -> int:
        """The furthest step that either sees."""
        return max(self.agent[-1], self.base)

    def for_agent(self, nominal: FloatArray) -> FloatArray:
        """What the agent sees of what is shown. Shapes (B, p, m)."""
        if nominal.shape[1] == len(self.agent):
            return nominal
        return nominal.take(np.array(self.agent) - 1, axis=1)

    def for_base(self, nominal: FloatArray) -> FloatArray:
        """What the base policy sees of what is shown. Shapes (B, p, m)."""
        return np.ascontiguousarray(nominal[:, : self.base])
