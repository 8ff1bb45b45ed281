"""Blocks of episodes that workers play, and what says that a worker has played just those."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import itertools
import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import llvmlite.binding as llvm

import ikgym
from baselines.canonical import canonical, jsonable
from baselines.evaluation.export import Motion
from baselines.evaluation.machine import describe
from baselines.evaluation.metrics import Row
from baselines.evaluation.plan import Job
from baselines.evaluation.trajectory_log import TrajectoryLog
from baselines.fingerprints import fingerprint
from baselines.oracle.best_known import MEANINGLESS
from baselines.workers import TOLERANCE, WorkerError

#: Most episodes that are played in step: what happens in them is in memory until all of them are done.
MOST = 64
#: The same on a cluster, where small units are spread better, and cost less where a node is lost.
BLOCK = 8
#: Units of each kind of machine of which an episode is played again here, no two of one policy.
REPLAYED = 3


class Played(NamedTuple):
    """A job that is done.

    Attributes:
        job: What was to be done.
        row: What came out.
        log: The trajectory log of the episode if the job is a first one.
        motion: The joint motion if it is to be kept.
    """

    job: Job
    row: Row
    log: TrajectoryLog | None
    motion: Motion | None


@dataclasses.dataclass(frozen=True, eq=False)
class Unit:
    """Episodes of one policy in one scenario.

    Args:
        jobs: The episodes.
    """

    jobs: tuple[Job, ...]

    @property
    def digest(self) -> str:
        """What the results are merged by: of version, scenario, policy, parameters, and what is drawn how.

        A worker works it out anew from what it has received, with its own version of the code.
        """
        first = self.jobs[0]
        about = [ikgym.__version__, fingerprint(first.scenario), first.preview]
        what = canonical(jsonable([*about, *([job.key, job.given, job.before] for job in self.jobs)]))
        return hashlib.sha256(what.encode()).hexdigest()[:24]


class Done(NamedTuple):
    """A unit that is done.

    Attributes:
        digest: Of what was done.
        played: What came out.
        processor: On what, see :func:`processor`.
    """

    digest: str
    played: list[Played]
    processor: str


@functools.cache
def processor() -> str:
    """What compiled code is made for here; the name of a processor says too little of it on virtual machines."""
    return f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"


def units(jobs: Iterable[Job], most: int = MOST) -> list[Unit]:
    """Jobs that are played together, in their order.

    Those that are timed are played alone. So are those of a reference that is made for one episode and knows no other:
    its jobs differ in what it is made with.

    Args:
        jobs: All of them.
        most: Most episodes in a unit.
    """
    out: list[Unit] = []
    for _, alike in itertools.groupby(jobs, _together):
        left = tuple(alike)
        size = 1 if left[0].timed else most
        out += [Unit(left[first : first + size]) for first in range(0, len(left), size)]
    return out


def _together(job: Job) -> tuple[object, ...]:
    return job.scenario.name, job.policy, canonical(job.parameters), canonical(jsonable(job.given)), job.timed


class Checks:
    """Holds what comes from workers against what they were asked to do, and against this machine.

    Args:
        play: Plays jobs here.
    """

    def __init__(self, play: Any) -> None:
        self._play, self._here = play, (_kind(describe()), processor())
        self._replayed: dict[tuple[str, str], set[str]] = {}

    def check(self, unit: Unit, done: Done) -> None:
        """Insists that a unit is what it should be.

        Raises:
            WorkerError: It is of other episodes, or has other costs than here.
        """
        there = done.played[0].row.machine
        if done.digest != unit.digest:
            first = unit.jobs[0]
            raise WorkerError(
                f"A worker has played something else than {first.policy} in {first.scenario.name}: it has ikgym "
                f"{there.get('ikgym')}, here is {ikgym.__version__}. Install the same on all nodes."
            )
        job, kind = unit.jobs[0], (_kind(there), done.processor)
        replayed = self._replayed.setdefault(kind, set())
        if len(replayed) < REPLAYED and job.policy not in replayed:
            replayed.add(job.policy)
            (again,) = self._play([dataclasses.replace(job, first=False, exported=False)])
            compare(done.played[0].row, again.row, 0.0 if kind == self._here else TOLERANCE)


def compare(there: Row, here: Row, tolerance: float) -> None:
    """Insists on equal costs."""
    for name in ("total_cost", "tracking_cost", "velocity_cost"):
        far, near = getattr(there, name), getattr(here, name)
        if not _same(far, near, tolerance):
            raise WorkerError(
                f"{there.policy} in {there.scenario}, seed {there.seed}: {name} is {far!r} on {_kind(there.machine)} "
                f"and {near!r} here; expected a relative difference of at most {tolerance:g}. Nothing of that unit is "
                "kept: install the same versions on all nodes."
            )


def _same(one: float, other: float, tolerance: float) -> bool:
    """Whether costs are equal, those among them that are no number."""
    if math.isnan(one) or math.isnan(other):
        return math.isnan(one) and math.isnan(other)
    return math.isclose(one, other, rel_tol=tolerance, abs_tol=MEANINGLESS if tolerance else 0.0)


def _kind(machine: Mapping[str, Any]) -> str:
    """What of a machine decides about the last bits of a number."""
    return canonical({name: value for name, value in machine.items() if name != "cores"})
