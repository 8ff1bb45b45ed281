"""The agents that come with the package: each is a policy by its name."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import ClassVar

from baselines.agents import files, untrusted
from baselines.agents.policy import LearnedPolicy
from baselines.agents.protocols import AgentFile
from baselines.files import ResultsError

FOLDER = pathlib.Path(__file__).parents[1] / "data" / "agents"


@dataclasses.dataclass(frozen=True, eq=False)
class ShippedAgent(LearnedPolicy):
    """An agent that comes with the package.

    Args:
        problem: What the policy is told of the scenario.
        hash: The first twelve digits of its hash, so that results of an agent and of its successor are told apart.

    Raises:
        ResultsError: The file has another hash, or cannot be used.
        InvalidInputError: The scenario does not fit the agent.
    """

    hash: str = ""

    #: Where the agents lie, each in a file with the name of its policy.
    folder: ClassVar[pathlib.Path] = FOLDER

    def load(self) -> AgentFile:
        """See :meth:`LearnedPolicy.load`."""
        file = files.parse_agent(self.name, untrusted.read(self.folder / f"{self.name}{untrusted.SUFFIX}"))
        if not isinstance(self.hash, str) or self.hash != file.digits:
            raise ResultsError(f"Agent {self.name} has the hash {file.digits}, expected {self.hash!r}.")
        return file


@dataclasses.dataclass(frozen=True, eq=False)
class AgentAlone(ShippedAgent):
    """Learned agent that stands alone, trained on `varga7-random` by apg."""

    hash: str = "25357e60147d"

    name: ClassVar[str] = "agent_alone"


@dataclasses.dataclass(frozen=True, eq=False)
class AgentPPO(ShippedAgent):
    """Learned agent that stands alone, trained on `varga7-random` by ppo."""

    hash: str = "bd450ee47520"

    name: ClassVar[str] = "agent_ppo"


@dataclasses.dataclass(frozen=True, eq=False)
class AgentResidual(ShippedAgent):
    """Learned correction of `rhc:horizon=400,iterations=1,move_blocks=30`, trained on `varga7-random` by imitate."""

    hash: str = "74e1d75a6e95"

    name: ClassVar[str] = "agent_residual"
