"""The command ``ikgym video``: an episode as a video, policies side by side."""

from __future__ import annotations

import dataclasses
import pathlib
import sys
from collections.abc import Sequence
from typing import Annotated

import tyro
from tqdm import tqdm

from baselines.cli import shell
from baselines.cli.parsing import if_random, parse
from baselines.files import check_writable
from baselines.viewer.film import check_ffmpeg, checked_width, moments, pictures, write_video
from baselines.viewer.replay import Stage, play_all
from ikgym.exceptions import InvalidInputError

PROGRAM = f"{shell.CONSOLE} video"


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the command."""

    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="FILE.mp4")]
    """The file to write."""
    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")] = "varga7-fast"
    """Name of a scenario, FILE.toml or MODULE:ATTRIBUTE."""
    policy: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = ("qp",)
    """Policies that are shown side by side, as evaluate takes them."""
    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Reset seed of the episode."""
    steps: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Number of steps; all of the scenario if left out."""
    fps: Annotated[float, tyro.conf.arg(metavar="N")] = 30.0
    """Pictures in one second of the video."""
    speed: Annotated[float, tyro.conf.arg(metavar="X")] = 1.0
    """Seconds of the episode in one second of the video: 0.1 is ten times slower than the arm."""
    width: Annotated[int, tyro.conf.arg(metavar="PIXELS")] = 960
    """Width of one policy's picture, which is half as high. Several policies stand in two columns."""


RULES = (if_random("--seed"),)


def manual() -> str:
    """The text of ``--help`` above the options."""
    prog = PROGRAM
    return f"""\
Draws an episode as an H.264 video: the arm, the paths and the errors over time, several policies at the same time.
Needs pip install "ikgym[video]".

Examples:
  {prog} --scenario panda-circle --policy qp --out circle.mp4
  {prog} --scenario varga7-fast --policy dls rhc rhc_foresight --speed 0.2 --width 1280 --out talk.mp4"""


def main(arguments: Sequence[str]) -> int:
    """The command line: words after the command; returns the exit code."""
    return shell.run(lambda: _film(parse(Options, arguments, prog=PROGRAM, description=manual(), rules=RULES)))


def _film(options: Options) -> int:
    check_ffmpeg()  # before episodes are played
    if options.out.suffix != ".mp4":
        raise InvalidInputError(f"out: expected a file that ends in .mp4, got {str(options.out)!r}.")
    width = checked_width(options.width)
    stage = Stage.of(options.scenario, options.seed, options.steps)
    steps = moments(stage, options.fps, options.speed)
    check_writable(options.out.absolute().parent)
    replays = play_all(stage, options.policy)
    content = tqdm(
        pictures(stage, replays, steps, width=width),
        total=len(steps),
        unit="picture",
        file=sys.stderr,
        dynamic_ncols=True,
    )
    write_video(options.out, content, options.fps)
    print(f"{options.out}: {len(steps)} pictures, {len(steps) / options.fps:.1f} s")
    return 0
