"""The command line of ``ikgym train ALGORITHM --env ID``: Stable-Baselines3 in the environments by id."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Sequence
from typing import Annotated

import tyro

from baselines.cli import shell
from baselines.cli.parsing import Rule
from ikgym import rl


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    algorithm: tyro.conf.Positional[str]
    """ppo, sac or td3."""
    env: Annotated[str, tyro.conf.arg(metavar="ID")]
    """The environment, such as ikgym/Track-v0."""
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (0,)
    """One run each, one after the other."""
    total_timesteps: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Steps of all arms together; n_timesteps of the settings if left out."""
    minutes: Annotated[float | None, tyro.conf.arg(metavar="X")] = None
    """CPU time of a run without validations, after which it ends early."""
    settings: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE.yml")] = None
    """Settings in the format of rl-zoo3; the published ones if left out."""
    defaults: bool = False
    """Take the defaults of Stable-Baselines3 and one arm in place of settings."""
    validations: Annotated[int, tyro.conf.arg(metavar="N")] = 10
    """Rows of the curve."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 32
    """Episodes of a validation."""
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder of the runs."""


RULES = (Rule(("--settings",), lambda given: not given.defaults, "with --defaults"),)


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Trains PPO, SAC or TD3 of Stable-Baselines3, unmodified, in an environment by id. rl-zoo3 trains the same from the same
settings: python -m rl_zoo3.train --algo ppo --env ikgym/Track-v0 --gym-packages ikgym -conf ppo.yml

{shell.listing("Environments", rl.IDS)}

Examples:
  {prog} ppo --env ikgym/Track-v0 --minutes 10 --seeds 0 1 2 --out runs/track-ppo
  {prog} sac --env ikgym/Reach-v0 --total-timesteps 100000 --out runs/reach-sac

Files, for each seed:
  DIR/seed-0/model.zip   the model, for Stable-Baselines3
  DIR/seed-0/curve.csv   CPU seconds, steps, and score on validation episodes: 0 standing still, 1 tuned dls
  DIR/seed-0/run.json    settings, seed and final score"""


def main(arguments: Sequence[str]) -> int:
    """The command line.

    Args:
        arguments: The words after ``train``.

    Returns:
        The exit code: 0, 2 after an expected error, 130 after Ctrl-C.
    """
    program = shell.program("train", "python train.py")
    return shell.run_resumable(Options, arguments, program, manual, _work, RULES)


def _work(options: Options, text: str) -> None:
    from baselines.training.by_id import Training  # imports PyTorch, an extra

    del text
    given = {field.name: getattr(options, field.name) for field in dataclasses.fields(options)}
    seeds, out = given.pop("seeds"), given.pop("out")
    for seed in dict.fromkeys(seeds):
        about = Training(**given, seed=seed).run(out / f"seed-{seed}")
        print(f"seed {seed}: score {about['validation_score']:.3f} after {about['steps']} steps", flush=True)
    print(f"\nwritten to {out}")
