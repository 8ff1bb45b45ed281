"""The agents that come with the package: each file is a policy by its name."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any, ClassVar

from baselines.agent import files
from baselines.agent.parts import DIGITS, AgentFile
from baselines.agent.policy import LearnedPolicy
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

    #: Where it lies.
    path: ClassVar[pathlib.Path]

    def load(self) -> AgentFile:
        """See :meth:`LearnedPolicy.load`."""
        file = files.parse_agent(self.name, files.read(self.path))
        if self.hash != file.digits:
            raise ResultsError(f"Agent {self.name} has the hash {file.digits}, expected {self.hash!r}.")
        return file


def shipped_agents(folder: pathlib.Path = FOLDER) -> dict[str, type[ShippedAgent]]:
    """One class for each file, by its name; its contents are read when a policy is made."""
    return {file.stem: _class_of(file) for file in sorted(folder.glob(f"*{files.SUFFIX}"))}


def _class_of(file: pathlib.Path) -> type[ShippedAgent]:
    try:
        with file.open("rb") as stream:
            about = files.parse_header(file.stem, stream.read(8 + files.MOST_HEADER))
        digits, words = str(about["hash"])[:DIGITS], _words(about)
    except (OSError, ResultsError) as e:
        # An agent that cannot be read is no reason to be unable to import all else: whoever makes it is told.
        digits, words = "", f"An agent that cannot be read: {e}"
    title = "".join(part.capitalize() for part in file.stem.split("_"))
    members = {"name": file.stem, "path": file, "__doc__": words, "__module__": __name__}
    return dataclasses.make_dataclass(
        title, [("hash", str, digits)], bases=(ShippedAgent,), namespace=members, frozen=True, eq=False
    )


def _words(about: dict[str, Any]) -> str:
    """What the tables say of an agent."""
    processing, training, scenario = (
        value if isinstance(value := about.get(key), dict) else {} for key in ("processing", "training", "scenario")
    )
    over, method = processing.get("over"), training.get("method")
    what = f"Learned correction of the actions of `{over}`" if over else "Learned agent that stands alone"
    return f"{what}, trained on `{scenario.get('name')}`" + (f" by {method}." if method else ".")


SHIPPED = shipped_agents()
# Where pickle looks for a class.
globals().update({made.__name__: made for made in SHIPPED.values()})
