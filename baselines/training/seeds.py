"""Several seeds in one call: one run each, in processes of their own."""

from __future__ import annotations

import dataclasses
import multiprocessing
import pathlib
import signal
import sys
import traceback
from collections.abc import Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess

from tqdm import tqdm

from baselines.lifetime import end_with_parent
from baselines.training.config.base import Config
from baselines.training.score import Score
from ikgym.exceptions import IkgymError


@dataclasses.dataclass(frozen=True)
class SeedRuns:
    """What all seeds have in common.

    Args:
        config: Of any method.
        out: The folder; a run with seed N has ``seed-N`` in it.
        resume: See :func:`baselines.training.run.train`.
        overwrite: See there.
        checkpoint_every: See there.
        command: See there.
    """

    config: Config
    out: pathlib.Path
    resume: bool = False
    overwrite: bool = False
    checkpoint_every: float = 0.0
    command: str = ""

    def folder(self, seed: int) -> pathlib.Path:
        """Where a run goes."""
        return self.out / f"seed-{seed}"


@dataclasses.dataclass(frozen=True)
class SeedResult:
    """What came of a seed.

    Args:
        seed: Which.
        score: Of the kept agent; None where the run failed.
        weights_sha256: Of the final weights; empty where it failed.
        error: Why it failed; empty where it did not.
    """

    seed: int
    score: Score | None = None
    weights_sha256: str = ""
    error: str = ""


#: What takes memory.
LESS_MEMORY = "Choose fewer arms (--n-envs), a smaller --buffer-size, --batch-size or network (--hidden)."


class Bar:
    """One progress bar for all seeds, on stderr."""

    def __init__(self, segments: int, seeds: int, *, show: bool) -> None:
        self._bar = tqdm(
            total=segments * seeds,
            disable=not show,
            file=sys.stderr,
            unit="segment",
            dynamic_ncols=True,
            # A log file has no cursor to go back with.
            mininterval=0.1 if sys.stderr.isatty() else 10.0,
        )
        self._done: dict[int, int] = {}
        self._scores: dict[int, str] = {}

    def advance(self, seed: int, done: int, score: Score | None) -> None:
        """Segments that a seed has done, and its last score."""
        if score is not None:
            number = score.cost if score.cost_ratio is None else score.cost_ratio
            self._scores[seed] = f"{'cost' if score.cost_ratio is None else 'cost ratio'} {number:.4g}"
            self._bar.set_description(
                " · ".join(f"seed {s}: {text}" for s, text in sorted(self._scores.items())), refresh=False
            )
        self._bar.update(done - self._done.get(seed, 0))
        self._done[seed] = done

    def close(self) -> None:
        """Leaves the bar as it stands."""
        self._bar.close()


def train_seeds(runs: SeedRuns, seeds: Sequence[int], *, workers: int, progress: bool) -> list[SeedResult]:
    """Trains one agent a seed.

    One seed is trained in this process; several in processes of their own, so that a seed that fails or dies takes no
    other with it.

    Args:
        runs: What they have in common.
        seeds: One run each.
        workers: Processes at a time.
        progress: Whether to show a bar on stderr.

    Returns:
        What came of each, in the order of the seeds.
    """
    bar = Bar(runs.config.segments, len(seeds), show=progress)
    try:
        if len(seeds) == 1:
            return [_train(runs, seeds[0], bar)]
        return _in_processes(runs, seeds, workers, bar)
    finally:
        bar.close()


def _train(runs: SeedRuns, seed: int, to: Bar | Connection) -> SeedResult:
    # PyTorch takes seconds to load, which the parent of processes has no need to do.
    from baselines.training.run import train

    def on_segment(done: int, score: Score | None) -> None:
        if isinstance(to, Bar):
            to.advance(seed, done, score)
        else:
            to.send((done, score))

    try:
        result = train(
            runs.config,
            seed,
            runs.folder(seed),
            resume=runs.resume,
            overwrite=runs.overwrite,
            checkpoint_every=runs.checkpoint_every,
            command=runs.command,
            on_segment=on_segment,
        )
    except IkgymError as e:
        return SeedResult(seed, error=" ".join(str(e).split()))
    except (MemoryError, RuntimeError) as e:
        if isinstance(e, RuntimeError) and "allocate memory" not in str(e):  # PyTorch's words
            raise
        return SeedResult(seed, error=f"Out of memory: {' '.join(str(e).split())[:200]}. {LESS_MEMORY}")
    return SeedResult(seed, result.score, result.weights_sha256)


def _in_processes(runs: SeedRuns, seeds: Sequence[int], workers: int, bar: Bar) -> list[SeedResult]:
    # Spawned, not forked: a fork would inherit numba's and the BLAS's threads without their locks' owners.
    context = multiprocessing.get_context("spawn")
    waiting, results = list(seeds), dict[int, SeedResult]()
    running: dict[Connection, tuple[int, SpawnProcess]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                seed = waiting.pop(0)
                here, there = context.Pipe(duplex=False)
                process = context.Process(target=_child, args=(runs, seed, there), daemon=True)
                process.start()
                there.close()
                running[here] = seed, process
            for connection in [pipe for pipe in wait(list(running)) if isinstance(pipe, Connection)]:
                seed, process = running[connection]
                try:
                    message = connection.recv()
                except EOFError:
                    process.join()
                    died = f"its process has died ({_ending(process.exitcode)}); go on with --resume"
                    results.setdefault(seed, SeedResult(seed, error=died))
                    del running[connection]
                    continue
                if isinstance(message, SeedResult):
                    results[seed] = message
                else:
                    bar.advance(seed, *message)
    finally:
        for _, process in running.values():  # nobody waits for them any more; their folders can be resumed
            process.terminate()
        for _, process in running.values():
            process.join()
    return [results[seed] for seed in seeds]


def _child(runs: SeedRuns, seed: int, connection: Connection) -> None:
    """The life of a process."""
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a traceback
    try:
        result = _train(runs, seed, connection)
    except Exception as e:
        traceback.print_exc()
        result = SeedResult(seed, error=f"{type(e).__name__}: {' '.join(str(e).split())}")
    connection.send(result)


def _ending(code: int | None) -> str:
    return f"signal {signal.Signals(-code).name}" if code is not None and code < 0 else f"exit code {code}"
