"""The command ``ikgym video``: an episode as a video, policies side by side."""

from __future__ import annotations

import dataclasses
import pathlib
import sys
import tempfile
from collections.abc import Iterator, Sequence
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import tyro
from tqdm import tqdm

from baselines.cli import shell
from baselines.cli.parsing import EpisodeOptions, if_random
from baselines.files import ResultsError, check_writable_file, write
from baselines.viewer.replay import Replay, Stage, play_all
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.rendering import Renderer
from ikgym.validation import Bounds

#: Most pictures of a video: about an hour.
MOST_PICTURES = 100_000


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options(EpisodeOptions):
    """Options of the command."""

    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="FILE.mp4")]
    """The file to write."""
    fps: Annotated[float, tyro.conf.arg(metavar="N"), Bounds(at_least=0.1, at_most=1000.0)] = 30.0
    """Pictures in one second of the video."""
    speed: Annotated[float, tyro.conf.arg(metavar="X"), Bounds(above=0.0)] = 1.0
    """Seconds of the episode in one second of the video: 0.1 is ten times slower than the arm."""
    width: Annotated[int, tyro.conf.arg(metavar="PIXELS"), Bounds(at_least=480, at_most=3840)] = 960
    """Width of one policy's picture, which is half as high. Several policies are in two columns."""


RULES = (if_random("--seed"),)


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Draws an episode as an H.264 video: the arm, the paths and the errors over time, several policies at the same time.
Needs pip install "ikgym[video]".

Examples:
  {prog} --scenario panda-circle --policy qp --out circle.mp4
  {prog} --scenario varga7-fast --policy dls rhc rhc_foresight --speed 0.2 --width 1280 --out talk.mp4"""


def _work(options: Options, _: str) -> None:
    try:
        from moviepy.video.io.ffmpeg_writer import FFMPEG_VideoWriter  # an extra
    except RuntimeError as e:
        raise MissingDependencyError(f"Videos need the program ffmpeg: {e}") from None
    if options.out.suffix != ".mp4":
        raise InvalidInputError(f"out: expected a file that ends in .mp4, got {str(options.out)!r}.")
    width, fps = options.width, options.fps
    if width % 4:  # a video has even sizes, and pictures are half as high as wide
        raise InvalidInputError(f"width: expected a multiple of 4 in [px], got {width}.")
    between = options.speed / fps
    stage = Stage.of(options.scenario, options.seed, options.steps)
    last = stage.scenario.steps
    if last * stage.scenario.dt > MOST_PICTURES * between:
        raise InvalidInputError(
            f"fps, speed: expected at most {MOST_PICTURES} pictures, got fps {fps:g} and speed {options.speed:g}."
        )
    check_writable_file(options.out)
    replays = play_all(stage, options.policies(stage.scenario))
    steps = np.append(np.rint(np.arange(0.0, last, between / stage.scenario.dt)), last).astype(np.int64)
    across = min(len(replays), 2)
    size = across * width, -(-len(replays) // across) * width // 2
    with tempfile.TemporaryDirectory() as folder:
        draft = pathlib.Path(folder) / "draft.mp4"
        try:
            with FFMPEG_VideoWriter(str(draft), size, fps, codec="libx264", preset="medium") as video:
                for picture in tqdm(pictures(stage, replays, steps, width), total=len(steps), file=sys.stderr):
                    video.write_frame(picture)
            written = draft.read_bytes()
        except OSError as e:
            raise ResultsError(f"Cannot write {options.out}: ffmpeg has failed ({e}).") from None
    write(options.out, written)
    print(f"{options.out}: {len(steps)} pictures, {len(steps) / fps:.1f} s")


def pictures(
    stage: Stage, replays: Sequence[Replay], steps: npt.NDArray[np.int64], width: int
) -> Iterator[npt.NDArray[np.uint8]]:
    """Draws an episode at some steps; the picture of each policy has a width in [px].

    Yields:
        Pictures with the policies in two columns, row by row, white where one is missing. Shape (height, width, 3).
    """
    scenario, across, known = stage.scenario, min(len(replays), 2), 0
    renderers = []
    for replay in replays:
        title = f"{scenario.name}: {replay.policy}"
        renderers.append(Renderer(scenario, "rgb_array", title=title, width=width))
        renderers[-1].begin(stage.frames[:, 9:])
    for step in steps.tolist():
        for renderer, replay in zip(renderers, replays, strict=True):
            for k in range(known, step + 1):
                errors = replay.position_error[k], replay.orientation_error[k]
                renderer.add(k, replay.q[k], *errors, stage.obstacles(k))
        known = step + 1
        tiles: list[Any] = [renderer.draw() for renderer in renderers]
        tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % across)
        yield np.vstack([np.hstack(tiles[k : k + across]) for k in range(0, len(tiles), across)])


main = shell.Command("video", Options, manual, _work, RULES)
