"""The command line of ``ikgym dataset``."""

from __future__ import annotations

import dataclasses
import pathlib
import sys
from collections.abc import Sequence
from typing import Annotated

import tyro

from baselines import command


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options:
    """What the command line takes."""

    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")]
    """A scenario: its name, FILE.toml, or MODULE:ATTRIBUTE."""
    policy: Annotated[str, tyro.conf.arg(metavar="POLICY")]
    """A policy as NAME or NAME:PARAMETER=VALUE,…, agent:PATH for an agent in a file, or MODULE:CLASS."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")]
    """Episodes: the first seeds of the split. A scenario that is the same at every reset has one."""
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder of the data set; its name is what Minari knows it by, with a version behind, such as dls-v0."""
    split: Annotated[str, tyro.conf.arg(metavar="NAME")] = "train"
    """Seeds of random scenarios: train, validation or test. Who learns from the test seeds can publish no score."""
    preview: Annotated[int | None, tyro.conf.arg(metavar="P")] = None
    """Steps ahead that are shown. What the policy asks for if left out."""
    trust: bool = False
    """Let the .zip file of an agent run the code in it: only one whose maker you know."""
    resume: bool = False
    """Go on with the data set in the folder: episodes that are there are not played again."""
    overwrite: bool = False
    """Replace the data set in the folder."""


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Plays episodes and writes them as a data set of Minari: observations, actions, rewards and infos, each episode with its
seed and its cost, and all of them with the scenario, the policy and the versions that they come from.

Example:
  {prog} --scenario varga7-random --policy dls:damping=1e-2 --episodes 100 --out datasets/dls-v0

In Python, with MINARI_DATASETS_PATH=datasets:
  minari.load_dataset("dls-v0")

Nothing can be read in DIR/data before all episodes are there; it is in one piece then."""


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        arguments: What stands behind the command; taken from the process if left out.

    Returns:
        The exit code: 0, 2 where something expected went wrong, 130 after Ctrl-C.
    """
    return command.run_resumable(Options, arguments, _program(), manual, _work)


def _work(options: Options, _: str) -> None:
    # Only who writes one needs Minari, and nobody who asks for help.
    from baselines.datasets.dataset import planned, write

    command.find_own_modules()
    wanted = planned(
        options.scenario,
        options.policy,
        episodes=options.episodes,
        split=options.split,
        preview=options.preview,
        trust=options.trust,
    )
    write(wanted, options.out, resume=options.resume, overwrite=options.overwrite, progress=True)
    folder = options.out.resolve()
    print(f'{options.out}: MINARI_DATASETS_PATH={options.out.parent}, minari.load_dataset("{folder.name}")')


def _program() -> str:
    return command.program("dataset", "python -m baselines.datasets.command")


if __name__ == "__main__":
    sys.exit(main())
