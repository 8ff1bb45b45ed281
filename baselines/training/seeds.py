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
from baselines.workers import TRIES, LostError, Report, Workers, finished
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


def train_seeds(runs: SeedRuns, seeds: Sequence[int], *, workers: Workers, progress: bool) -> list[SeedResult]:
    """Trains one agent a seed.

    One seed is trained in this process; several in processes of their own, so that a seed that fails or dies takes no
    other with it. Nodes of a cluster write into the folder of the runs, which all of them see: a seed whose node is
    lost goes on elsewhere from its last checkpoint.

    Args:
        runs: What they have in common.
        seeds: One run each.
        workers: Who trains.
        progress: Whether to show a bar on stderr.

    Returns:
        What came of each, in the order of the seeds.

    Raises:
        ClusterError: There is no cluster.
    """
    bar = Bar(runs.config.segments, len(seeds), show=progress)
    try:
        if workers.cluster is None and len(seeds) == 1:
            return [train_seed(Seed(runs, seeds[0]), lambda said: bar.advance(seeds[0], *said))]
        return _elsewhere(runs, seeds, workers, bar)
    finally:
        bar.close()


@dataclasses.dataclass(frozen=True)
class Seed:
    """What a worker does.

    Args:
        runs: What all seeds have in common.
        seed: Which.
        mark: The name of a file in the folder of the runs that a worker of a cluster has to see; empty elsewhere.
    """

    runs: SeedRuns
    seed: int
    mark: str = ""


def train_seed(one: Seed, report: Report) -> SeedResult:
    """Trains the agent of a seed, in the process of a worker.

    Args:
        one: Which.
        report: Told the segments that are done, and the last score.
    """
    # PyTorch takes seconds to load, which the parent of processes has no need to do.
    from baselines.training.run import train

    runs, seed = one.runs, one.seed
    if one.mark and not (runs.out / one.mark).exists():
        unseen = f"{platform.node()} does not see {runs.out}: expected a folder that all nodes of the cluster share"
        return SeedResult(seed, error=unseen)
    try:
        result = train(
            runs.config,
            seed,
            runs.folder(seed),
            resume=runs.resume,
            overwrite=runs.overwrite,
            checkpoint_every=runs.checkpoint_every,
            command=runs.command,
            on_segment=lambda done, score: report((done, score)),
        )
    except IkgymError as e:
        return SeedResult(seed, error=" ".join(str(e).split()))
    except (MemoryError, RuntimeError) as e:
        if isinstance(e, RuntimeError) and "allocate memory" not in str(e):  # PyTorch's words
            raise
        return SeedResult(seed, error=f"Out of memory: {' '.join(str(e).split())[:200]}. {LESS_MEMORY}")
    return SeedResult(seed, result.score, result.weights_sha256)


def attempt(one: Seed, report: Report) -> SeedResult:
    """The same, whatever goes wrong: other seeds go on."""
    try:
        return train_seed(one, report)
    except Exception as e:
        traceback.print_exc()
        return SeedResult(one.seed, error=f"{type(e).__name__}: {' '.join(str(e).split())}")


def _elsewhere(runs: SeedRuns, seeds: Sequence[int], workers: Workers, bar: Bar) -> list[SeedResult]:
    results = dict[int, SeedResult]()
    far = workers.cluster is not None
    shared = dataclasses.replace(runs, out=runs.out.absolute()) if far else runs
    with workers.pool(len(seeds)) as pool, _marked(shared.out, far) as mark:
        every = [Seed(shared, seed, mark) for seed in seeds]
        # A process of this machine that dies has not done so by chance.
        tries = TRIES if far else 1

        def heard(one: Seed, said: tuple[int, Score | None]) -> None:
            bar.advance(one.seed, *said)

        done = finished(pool, attempt, every, tries=tries, again=_resumed, report=heard)
        for one, result in done:
            if isinstance(result, LostError):
                result = SeedResult(one.seed, error=f"{result}; go on with --resume")
            elif not result.error:
                bar.advance(one.seed, runs.config.segments, result.score)
            results[one.seed] = result
    return [results[seed] for seed in seeds]


def _resumed(one: Seed) -> Seed:
    """A seed whose node was lost: it goes on from its last checkpoint."""
    return dataclasses.replace(one, runs=dataclasses.replace(one.runs, resume=True, overwrite=False))


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
        file.unlink(missing_ok=True)
