"""Several seeds in one call: one run each, in separate processes or on a cluster."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
import platform
import sys
import traceback
import uuid
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

import tyro
from tqdm import tqdm

from baselines.files import write
from baselines.training.config.base import Config
from baselines.workers import ALONE, TRIES, WorkerError, Workers, finished
from ikgym.exceptions import IkgymError

if TYPE_CHECKING:  # the command line is read without agents
    from baselines.training.validation import Score


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Options of runs that do not change their results."""

    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the files; the run with seed N has the folder seed-N in it."""
    resume: bool = False
    """Continue the runs in the folder; they end with the same weights as without the interruption."""
    overwrite: bool = False
    """Replace the runs in the folder."""
    checkpoint_every: Annotated[float, tyro.conf.arg(metavar="SECONDS")] = 15.0
    """Shortest time between two checkpoints; there are none within a segment."""
    progress: bool = True
    """Show a progress bar."""

    def folder(self, seed: int) -> pathlib.Path:
        """The folder of a run."""
        return self.out / f"seed-{seed}"


@dataclasses.dataclass(frozen=True)
class SeedResult:
    """The result of a seed.

    Args:
        seed: The seed.
        score: Of the kept agent; None where the run failed.
        weights_sha256: Of the final weights; empty where it failed.
        error: Why it failed; empty otherwise.
    """

    seed: int
    score: Score | None = None
    weights_sha256: str = ""
    error: str = ""


#: The advice where memory is short.
LESS_MEMORY = "Choose fewer arms (--n-envs), a smaller network (--hidden), or --set buffer_size=…"


class Bar:
    """The progress bar of one seed, on stderr.

    Args:
        segments: Segments of the training.
        seed: The seed.
        line: The line of the bar below the cursor; None for no bar.
    """

    def __init__(self, segments: int, seed: int, line: int | None) -> None:
        self._bar = tqdm(
            total=segments,
            desc=f"seed {seed}",
            disable=line is None,
            position=line,
            file=sys.stderr,
            unit="segment",
            dynamic_ncols=True,
            mininterval=0.1 if sys.stderr.isatty() else 10.0,
        )
        self._seed = seed

    def advance(self, done: int, score: Score | None) -> None:
        """Shows the number of finished segments, and the last score."""
        if score is not None:
            number = score.cost if score.cost_ratio is None else score.cost_ratio
            text = f"{'cost' if score.cost_ratio is None else 'cost ratio'} {number:.4g}"
            self._bar.set_description(f"seed {self._seed}: {text}", refresh=False)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        """Leaves the bar as it is."""
        self._bar.close()


def train_seeds(
    config: Config, options: RunOptions, seeds: Sequence[int], *, workers: Workers = ALONE, command: str = ""
) -> list[SeedResult]:
    """Trains one agent a seed.

    One seed is trained in this process, several in separate ones, so that a seed that fails does not end the others.
    On a cluster, all nodes write into one shared folder: a seed whose node is lost is resumed elsewhere from its last
    checkpoint.

    Args:
        config: Of any method.
        options: The common options.
        seeds: One run each.
        workers: Processes of this machine or of a cluster.
        command: The command that began the runs, for `run.json`.

    Returns:
        The results, in the order of the seeds.

    Raises:
        ClusterError: There is no cluster.
    """
    far = workers.cluster is not None
    lines = [line if options.progress and not far else None for line in range(len(seeds))]
    if len(seeds) == 1 and not far:
        return [train_seed(Seed(config, options, command, seeds[0], line=lines[0]))]
    shared = dataclasses.replace(options, out=options.out.absolute()) if far else options
    results = dict[int, SeedResult]()
    tries = TRIES if far else 1  # on one machine a second attempt would fail again
    with _marked(shared.out, far) as mark:
        every = [Seed(config, shared, command, seed, mark, line) for seed, line in zip(seeds, lines, strict=True)]
        for one, future in finished(attempt, every, workers, tries=tries):
            try:
                results[one.seed] = future.result()
            except WorkerError as e:
                results[one.seed] = SeedResult(one.seed, error=f"{e} Continue with --resume.")
    return [results[seed] for seed in seeds]


@dataclasses.dataclass(frozen=True)
class Seed:
    """The task of a worker.

    Args:
        config: Of any method.
        options: The common options.
        command: The command that began the run.
        seed: The seed.
        mark: The name of a file that shows a worker of a cluster that the folder is shared; empty on one machine.
        line: See :class:`Bar`.
    """

    config: Config
    options: RunOptions
    command: str
    seed: int
    mark: str = ""
    line: int | None = None


def train_seed(one: Seed) -> SeedResult:
    """Trains the agent of a seed, in the process of a worker."""
    # PyTorch takes seconds to load, and the parent process does not need it.
    from baselines.training.run import train

    options, seed = one.options, one.seed
    if one.mark and not (options.out / one.mark).exists():
        unseen = f"{platform.node()} does not see {options.out}: expected a folder that all nodes of the cluster share"
        return SeedResult(seed, error=unseen)
    begun = options.out / f"{one.mark}-{seed}"
    again = bool(one.mark) and begun.exists()  # on a node that was lost
    if one.mark:
        begun.touch()
    bar = Bar(one.config.segments, seed, one.line)
    try:
        result = train(
            one.config,
            seed,
            options.folder(seed),
            resume=options.resume or again,
            overwrite=options.overwrite and not again,
            checkpoint_every=options.checkpoint_every,
            command=one.command,
            on_segment=bar.advance,
        )
    except IkgymError as e:
        return SeedResult(seed, error=" ".join(str(e).split()))
    except (MemoryError, RuntimeError) as e:
        if isinstance(e, RuntimeError) and "allocate memory" not in str(e):  # PyTorch's words
            raise
        return SeedResult(seed, error=f"Out of memory: {' '.join(str(e).split())[:200]}. {LESS_MEMORY}")
    finally:
        bar.close()
    return SeedResult(seed, result.score, result.weights_sha256)


def attempt(one: Seed) -> SeedResult:
    """The same, with any error as a result, so that other seeds continue."""
    try:
        return train_seed(one)
    except Exception as e:
        traceback.print_exc()
        return SeedResult(one.seed, error=f"{type(e).__name__}: {' '.join(str(e).split())}")


@contextlib.contextmanager
def _marked(folder: pathlib.Path, wanted: bool) -> Iterator[str]:
    """The name of a file that exists meanwhile in a folder; empty if not wanted."""
    if not wanted:
        yield ""
        return
    file = folder / f".cluster-{uuid.uuid4().hex}"
    write(file, b"")
    try:
        yield file.name
    finally:
        for left in folder.glob(f"{file.name}*"):
            left.unlink()
