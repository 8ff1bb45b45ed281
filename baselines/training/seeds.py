"""Several seeds in one call: one run each, in processes of their own."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
import platform
import sys
import traceback
import uuid
from collections.abc import Iterator, Sequence

from tqdm import tqdm

from baselines.files import write
from baselines.training.config.base import Config
from baselines.training.score import Score
from baselines.workers import TRIES, WorkerError, Workers, finished
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
            # A log file has no cursor to go back with.
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


def train_seeds(runs: SeedRuns, seeds: Sequence[int], *, workers: Workers, progress: bool) -> list[SeedResult]:
    """Trains one agent a seed.

    One seed is trained in this process; several in processes of their own, so that a seed that fails or dies takes no
    other with it. Nodes of a cluster write into the folder of the runs, which all of them see: a seed whose node is
    lost is resumed elsewhere from its last checkpoint.

    Args:
        runs: What they have in common.
        seeds: One run each.
        workers: Who trains.
        progress: Whether to show bars on stderr.

    Returns:
        What came of each, in the order of the seeds.

    Raises:
        ClusterError: There is no cluster.
    """
    lines = {seed: line if progress and workers.cluster is None else None for line, seed in enumerate(seeds)}
    if workers.cluster is None and len(seeds) == 1:
        return [train_seed(Seed(runs, seeds[0], line=lines[seeds[0]]))]
    far = workers.cluster is not None
    shared = dataclasses.replace(runs, out=runs.out.absolute()) if far else runs
    results = dict[int, SeedResult]()
    tries = TRIES if far else 1  # a process of this machine that dies does not do so by chance
    with _marked(shared.out, far) as mark:
        every = [Seed(shared, seed, mark, lines[seed]) for seed in seeds]
        for one, future in finished(attempt, every, workers, tries=tries):
            try:
                results[one.seed] = future.result()
            except WorkerError as e:
                results[one.seed] = SeedResult(one.seed, error=f"{e} Continue with --resume.")
    return [results[seed] for seed in seeds]


@dataclasses.dataclass(frozen=True)
class Seed:
    """What a worker does.

    Args:
        runs: What all seeds have in common.
        seed: Which.
        mark: The name of a file in the folder of the runs that a worker of a cluster has to see; empty elsewhere.
        line: See :class:`Bar`.
    """

    runs: SeedRuns
    seed: int
    mark: str = ""
    line: int | None = None


def train_seed(one: Seed) -> SeedResult:
    """Trains the agent of a seed, in the process of a worker."""
    # PyTorch takes seconds to load, which the parent of processes has no need to do.
    from baselines.training.run import train

    runs, seed = one.runs, one.seed
    if one.mark and not (runs.out / one.mark).exists():
        unseen = f"{platform.node()} does not see {runs.out}: expected a folder that all nodes of the cluster share"
        return SeedResult(seed, error=unseen)
    begun = runs.out / f"{one.mark}-{seed}"
    again = bool(one.mark) and begun.exists()  # on a node that was lost
    if one.mark:
        begun.touch()
    bar = Bar(runs.config.segments, seed, one.line)
    try:
        result = train(
            runs.config,
            seed,
            runs.folder(seed),
            resume=runs.resume or again,
            overwrite=runs.overwrite and not again,
            checkpoint_every=runs.checkpoint_every,
            command=runs.command,
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
    """Trains the agent of a seed; whatever goes wrong, other seeds go on."""
    try:
        return train_seed(one)
    except Exception as e:
        traceback.print_exc()
        return SeedResult(one.seed, error=f"{type(e).__name__}: {' '.join(str(e).split())}")


@contextlib.contextmanager
def _marked(folder: pathlib.Path, wanted: bool) -> Iterator[str]:
    """A file by which workers tell that they see the folder of this machine; its name."""
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
