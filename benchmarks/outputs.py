"""What each output of a bilinear agent is worth: ``python -m benchmarks.outputs --agent FILE --out FILE``.

Plays the agent with some of its outputs set to 0, writes what each has cost into --out, and prints a table: the
geometric mean of the cost divided by that of the whole agent on the same episodes. Without --agent the table is that of
what is in --out.
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
import tempfile
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import tyro
from tqdm import tqdm

from baselines import registry
from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.files import load_agent, save_agent
from baselines.agents.network import Network
from baselines.evaluation.pages.markdown import table
from baselines.files import json_files, write
from benchmarks.paired import play, ratios
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError

HEAD = ("what the network gives", "cost ratio to the whole", "median", "lost")

#: What is kept; all else is 0.
KEPT: Mapping[str, tuple[str, ...]] = {
    "G, h, λ, U": ("G", "h", "λ", "U"),
    "h, λ, U": ("h", "λ", "U"),
    "G, λ, U": ("G", "λ", "U"),
    "G, h, U": ("G", "h", "U"),
    "G, h, λ": ("G", "h", "λ"),
    "G": ("G",),
    "h": ("h",),
    "λ, U": ("λ", "U"),
    "nothing": (),
}


@dataclasses.dataclass(frozen=True)
class Command:
    """Plays an agent without some of its outputs."""

    out: pathlib.Path
    """The file, .json."""
    agent: pathlib.Path | None = None
    """An agent.safetensors; if left out nothing is played."""
    scenario: str = "varga7-pose-random"
    """Whose episodes are played."""
    split: Annotated[str, tyro.conf.arg(metavar="NAME")] = "test"
    """Of the seeds of the episodes."""
    episodes: int = 256
    """The first so many."""


def parts(joints: int, outputs: int) -> dict[str, npt.NDArray[np.int64]]:
    """Which outputs of a network with a matrix and an inverse are G, h, ln λ and ln U.

    Args:
        joints: n.
        outputs: n (w + 1) + 1 + n.
    """
    rows = np.arange(outputs - 1 - joints).reshape(joints, -1)
    behind = np.arange(rows.size, outputs)
    return {"G": rows[:, :-1].ravel(), "h": rows[:, -1], "λ": behind[:1], "U": behind[1:]}


def keeping(network: Network, outputs: npt.NDArray[np.int64]) -> Network:
    """A network whose other outputs are 0.

    Args:
        network: Whose outputs are linear.
        outputs: Numbers of those that stay.
    """
    weight, bias = np.zeros_like(network.weights[-1]), np.zeros_like(network.biases[-1])
    weight[outputs], bias[outputs] = network.weights[-1][outputs], network.biases[-1][outputs]
    weights, biases = (*network.weights[:-1], weight), (*network.biases[:-1], bias)
    return dataclasses.replace(network, weights=weights, biases=biases)


def played(command: Command) -> dict[str, Any]:
    """What the agent has cost without some of its outputs.

    Raises:
        InvalidInputError: Its network gives no matrix beside an inverse.
        UnknownNameError: There is no such scenario or split.
    """
    assert command.agent is not None
    scenario, seeds = scenarios.get(command.scenario), scenarios.seeds(command.split, command.episodes)
    whole = load_agent(command.agent)
    processing, network = whole.processing, whole.network
    if not isinstance(processing, Bilinear) or processing.damping is None or not processing.matrix:
        raise InvalidInputError(f"agent: expected a bilinear one with a matrix beside an inverse, got {processing}.")
    assert isinstance(network, Network)
    found = parts(scenario.joints, network.outputs)
    content: dict[str, Any] = {name: getattr(command, name) for name in ("scenario", "split", "episodes")} | {
        "agent": str(command.agent),
        "played": {},
    }
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "agent.safetensors"
        for label, names in tqdm(KEPT.items(), unit="agent"):
            kept = np.concatenate([np.zeros(0, dtype=np.int64), *(found[name] for name in names)])
            save_agent(file, keeping(network, kept), processing, scenario)
            content["played"][label] = play(scenario, registry.make("agent", scenario, path=str(file)), seeds)._asdict()
    return content


def lines(content: dict[str, Any]) -> list[str]:
    """The table."""
    everybody = content["played"]
    costs = {label: np.array([one["costs"]]) for label, one in everybody.items()}
    first, *others = everybody
    told = {first: ["1", "1"]} | {label: ratios(costs[label], costs[first]) for label in others}
    rows = [[label, *told[label], f"{one['lost']} of {len(one['costs'])}"] for label, one in everybody.items()]
    return table(HEAD, rows, text=(0, 1))


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line.

    Args:
        arguments: What stands behind the command; taken from the process if left out.
    """
    command = tyro.cli(Command, description=__doc__, args=arguments)
    if command.agent is not None:
        write(command.out, (json.dumps(played(command)) + "\n").encode())
    print("\n".join(lines(json_files.read(command.out))))


if __name__ == "__main__":
    main()
