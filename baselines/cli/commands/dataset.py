"""The command line of ``ikgym dataset``."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Annotated

import tyro

from baselines.cli import shell
from baselines.cli.parsing import Count, if_random
from ikgym.frozen import Frozen


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options(Frozen):
    """Options of the command."""

    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")]
    """A scenario: its name, FILE.toml, or MODULE:ATTRIBUTE."""
    policy: Annotated[str, tyro.conf.arg(metavar="POLICY")]
    """A policy as NAME or NAME:PARAMETER=VALUE,…, agent:PATH for an agent in a file, or MODULE:CLASS."""
    episodes: Count
    """Number of episodes, the first seeds of the split. A scenario that is the same at every reset has one."""
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder of the data set. Minari knows the data set by its name, which ends with a version, such as dls-v0."""
    split: Annotated[str, tyro.conf.arg(metavar="NAME")] = "train"
    """Seeds of random scenarios: train, validation or test. Scores of agents that learn from test are void."""
    preview: Annotated[int | None, tyro.conf.arg(metavar="P")] = None
    """Steps ahead that the policy is shown; its preview if left out."""
    overwrite: bool = False
    """Replace the data set in the folder."""


RULES = (if_random("--split"),)


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Plays episodes and writes them as a data set of Minari: observations, actions, rewards and infos, with the seed and the
cost of each episode, and the scenario, the policy and the versions.

Example:
  {prog} --scenario varga7-random --policy dls:damping=1e-2 --episodes 100 --out datasets/dls-v0

In Python, with MINARI_DATASETS_PATH=datasets:
  minari.load_dataset("dls-v0")

DIR/data appears in one go when all episodes are written."""


def _work(options: Options, _: str) -> None:
    from baselines import datasets  # imports Minari, an extra

    datasets.write(**{field.name: getattr(options, field.name) for field in dataclasses.fields(options)}, progress=True)
    name = options.out.absolute().name
    print(f'{options.out}: MINARI_DATASETS_PATH={options.out.parent}, minari.load_dataset("{name}")')


main = shell.Command("dataset", Options, manual, _work, RULES)
