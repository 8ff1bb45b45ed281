"""A video of an episode: one picture for each policy, all at the same time."""

from __future__ import annotations

import itertools
import pathlib
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.files import ResultsError, write
from baselines.viewer.replay import Replay, Stage
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.rendering import Renderer
from ikgym.validation import number, whole_number

Picture = npt.NDArray[np.uint8]

# Smallest and largest width of the picture of one policy in [px].
NARROWEST, WIDEST = 480, 3840
# Widths are multiples of it: a video takes even sizes, and pictures are half as high as wide.
STEP = 4
# Most pictures of a video: about an hour.
MOST_PICTURES = 100_000


def moments(stage: Stage, fps: float, speed: float) -> npt.NDArray[np.int64]:
    """The steps that are drawn, from the start to the end of the episode. Shape (pictures,).

    `speed` is how many seconds of the episode one second of the video shows.
    """
    steps = stage.scenario.steps
    between = number("speed", speed, above=0.0) / number("fps", fps, at_least=0.1, at_most=1000.0) / stage.scenario.dt
    if steps > MOST_PICTURES * between:
        raise InvalidInputError(
            f"fps, speed: expected at most {MOST_PICTURES} pictures, got fps {fps:g} and speed {speed:g}."
        )
    return np.append(np.rint(np.arange(0.0, steps, between)), steps).astype(np.int64)


def checked_width(width: int) -> int:
    """A width of pictures in [px]."""
    if whole_number("width", width, at_least=NARROWEST, at_most=WIDEST) % STEP:
        raise InvalidInputError(f"width: expected a multiple of {STEP} from {NARROWEST} to {WIDEST} [px], got {width}.")
    return width


def pictures(stage: Stage, replays: Sequence[Replay], steps: npt.NDArray[np.int64], *, width: int) -> Iterator[Picture]:
    """Draws an episode.

    Yields:
        Pictures with the policies in two columns, row by row, white where one is missing. Shape (height, width, 3).
    """
    scenario, across = stage.scenario, min(len(replays), 2)
    renderers = []
    for replay in replays:
        title = f"{scenario.name}: {replay.policy}"
        renderers.append(Renderer(scenario, "rgb_array", title=title, width=width))
        renderers[-1].begin(stage.frames[:, 9:])
    known = 0
    for step in steps.tolist():
        for renderer, replay in zip(renderers, replays, strict=True):
            for k in range(known, step + 1):
                errors = replay.position_error[k], replay.orientation_error[k]
                renderer.add(k, replay.q[k], *errors, stage.obstacles(k))
        known = step + 1
        tiles: list[Any] = [renderer.draw() for renderer in renderers]
        tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % across)
        yield np.vstack([np.hstack(tiles[k : k + across]) for k in range(0, len(tiles), across)])


def check_ffmpeg() -> None:
    """Checks that moviepy and the program ffmpeg, which comes with it, are installed.

    Raises:
        ModuleNotFoundError: moviepy is not installed.
        MissingDependencyError: It finds no ffmpeg that starts.
    """
    try:
        from moviepy import config

        starts, reason = config.try_cmd([config.FFMPEG_BINARY, "-version"])
    except (OSError, RuntimeError) as e:  # moviepy looks for ffmpeg when it is imported
        starts, reason = False, e
    if not starts:
        raise MissingDependencyError(
            f'Videos need the program ffmpeg, which pip install "ikgym[video]" brings for most machines ({reason}).'
        )


def write_video(file: pathlib.Path, content: Iterable[Picture], fps: float) -> None:
    """Writes pictures of one even size as an H.264 video ``.mp4``, in one go when all of them are drawn."""
    from moviepy.video.io.ffmpeg_writer import FFMPEG_VideoWriter

    left = iter(content)
    first = next(left)
    height, width, _ = first.shape
    with tempfile.TemporaryDirectory() as folder:
        draft = pathlib.Path(folder) / "draft.mp4"
        try:
            with FFMPEG_VideoWriter(str(draft), (width, height), fps, codec="libx264", preset="medium") as video:
                for picture in itertools.chain([first], left):
                    video.write_frame(picture)
            written = draft.read_bytes()
        except OSError as e:
            raise ResultsError(f"Cannot write {file}: ffmpeg has failed ({e}).") from None
        write(file, written)
