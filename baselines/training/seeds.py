"""Several seeds in one call: one run each, in separate processes or on a cluster."""

from __future__ import annotations

import dataclasses
import pathlib
import platform
import sys
import traceback
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import tyro
from tqdm import tqdm

from baselines.files import check_flags, locked
from baselines.training.config import APG
from baselines.training.folder import Folder
from baselines.workers import ALONE, TRIES, WorkerError, Workers, finished
from ikgym.exceptions import IkgymError
from ikgym.validation import number

if TYPE_CHECKING:  # the command line is read without PyTorch
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

    def __post_init__(self) -> None:
        number("checkpoint_every", self.checkpoint_every, at_least=0.0)

    def folder(self, seed: int) -> pathlib.Path:
        """The folder of a run."""
        return self.out / f"seed-{seed}"


@dataclasses.dataclass(frozen=True)
class Seed:
    """The job of a worker: one seed.

    Args:
        config: The options.
        options: The options of the run.
        command: The command that started the run.
        seed: The seed.
        line: The line of the progress bar below the cursor; None for no bar.
        remote: Whether a node of a cluster does it.
    """

    config: APG
    options: RunOptions
    command: str
    seed: int
    line: int | None = None
    remote: bool = False


def train_seeds(
    config: APG, options: RunOptions, seeds: Sequence[int], *, workers: Workers = ALONE, command: str = ""
) -> dict[int, str]:
    """Trains one agent a seed; returns why each seed failed, in the order of the seeds, and "" where it did not.

    One seed is trained in this process, several in separate ones, so that a seed that fails does not end the others. On
    a cluster, all nodes write into one shared folder: if a node is lost, its seed is resumed elsewhere from the last
    checkpoint.

    Raises:
        ClusterError: There is no cluster.
        ResultsError: On a cluster: a run exists, and is neither resumed nor overwritten.
    """
    remote = workers.cluster is not None
    if remote:
        options = _shared(options, seeds)
    lines = [line if options.progress and not remote else None for line in range(len(seeds))]
    jobs = [Seed(config, options, command, seed, line, remote) for seed, line in zip(seeds, lines, strict=True)]
    if len(jobs) == 1 and not remote:
        return {jobs[0].seed: train_seed(jobs[0])}
    errors = dict.fromkeys(seeds, "")
    tries = TRIES if remote else 1  # on one machine a second attempt would fail again
    for job, future in finished(train_seed, jobs, workers, tries=tries):
        try:
            errors[job.seed] = future.result()
        except WorkerError as e:
            errors[job.seed] = f"{e} Continue with --resume."
        except Exception as e:  # an error of the program does not end the other seeds
            traceback.print_exc()
            errors[job.seed] = f"{type(e).__name__}: {' '.join(str(e).split())}"
    return errors


def _shared(options: RunOptions, seeds: Sequence[int]) -> RunOptions:
    """Clears or keeps the folders of a cluster's runs, and lets the nodes resume, so that a lost seed continues."""
    for folder in (Folder(options.folder(seed)) for seed in seeds):
        check_flags(folder.run, resume=options.resume, overwrite=options.overwrite)
        with locked(folder.path):
            if not options.resume:
                folder.clear()
    return dataclasses.replace(options, out=options.out.absolute(), resume=True, overwrite=False)


def train_seed(job: Seed) -> str:
    """Trains the agent of a seed, in the process of a worker; returns why it failed, or ""."""
    # PyTorch takes seconds to load, and the parent process does not need it.
    from baselines.training.run import train

    options, folder = job.options, job.options.folder(job.seed)
    if job.remote and not folder.exists():
        return f"{platform.node()} does not see {options.out}: expected a folder that all nodes of the cluster share"
    bar = tqdm(
        total=job.config.segments,
        desc=f"seed {job.seed}",
        disable=job.line is None,
        position=job.line,
        file=sys.stderr,
        unit="segment",
        dynamic_ncols=True,
        mininterval=0.1 if sys.stderr.isatty() else 10.0,
    )

    def show(done: int, score: Score | None) -> None:
        if score is not None:
            bar.set_description(f"seed {job.seed}: cost {score.cost:.4g}", refresh=False)
        bar.update(done - bar.n)

    try:
        with bar:
            train(
                job.config,
                job.seed,
                folder,
                resume=options.resume,
                overwrite=options.overwrite,
                checkpoint_every=options.checkpoint_every,
                command=job.command,
                on_segment=show,
            )
    except IkgymError as e:
        return " ".join(str(e).split())
    except MemoryError as e:
        advice = "Choose fewer arms (--n-envs) or a smaller network (--hidden)."
        return f"Out of memory: {' '.join(str(e).split())}. {advice}"
    return ""
