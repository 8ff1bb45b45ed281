"""What the page is made from: policies that were played, initial trajectories that were scored, and their file."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Iterator, Mapping
from typing import Any, Self

import numpy as np
from threadpoolctl import threadpool_limits

from baselines import registry
from baselines.canonical import one_line, with_list
from baselines.episodes import rollout
from baselines.evaluation.pages.elsewhere.followed import Followed, followed
from baselines.files import json_files, write
from baselines.fingerprints import fingerprint
from baselines.status import Status
from ikgym import problems, scenarios
from ikgym.scenarios.elsewhere import RANDOM, waypoint_steps

#: Who plays, and which of them take so long that they may be given fewer random paths.
POLICIES = ("dls", "null_space", "qp", "rhc", "rhc_foresight")
COSTLY = ("rhc_foresight",)


@dataclasses.dataclass(frozen=True)
class Run:
    """A policy, or a published initial trajectory, on a path.

    Args:
        problem: The path.
        who: The policy, or the method that the trajectory was made by, one of :data:`ikgym.problems.METHODS`.
        fingerprint: Of the scenario.
        followed: How it follows the waypoints.
        at_stop: Steps in which a stop held a joint back; None for a trajectory, which was not played.
        at_velocity_limit: Steps in which a velocity limit did.
        status: The worst status of the policy.
        time_p50_us: Median time of a call of the policy, in [µs].
    """

    problem: str
    who: str
    fingerprint: str
    followed: Followed
    at_stop: int | None = None
    at_velocity_limit: int | None = None
    status: str | None = None
    time_p50_us: float | None = None


@dataclasses.dataclass(frozen=True)
class Measured:
    """All that the page says.

    Args:
        command: The command that measured it.
        date: When, in UTC.
        machine: On what, see :func:`baselines.evaluation.machine.describe`.
        runs: Everybody on every path.
    """

    command: str
    date: str
    machine: Mapping[str, Any]
    runs: tuple[Run, ...]

    def save(self, file: pathlib.Path) -> None:
        """Writes it as JSON, a run a line.

        Raises:
            ResultsError: The file cannot be written.
        """
        head = {"command": self.command, "date": self.date, "machine": dict(self.machine)}
        runs = [one_line(dataclasses.asdict(one)) for one in self.runs]
        write(file, (with_list(head, "runs", runs) + "\n").encode())

    @classmethod
    def load(cls, file: pathlib.Path) -> Self:
        """What :meth:`save` wrote.

        Raises:
            ResultsError: It cannot be read, or is damaged.
        """
        with json_files.reading("what was measured", file):
            return json_files.made(cls, json_files.read(file))


def everybody(paths: int = problems.RANDOM) -> Iterator[tuple[str, str]]:
    """Paths, and who is on each of them; the many random paths come last.

    Args:
        paths: The first so many random ones are for those that take long, too.
    """
    random = problems.names(RANDOM)
    for name in (*(name for name in problems.NAMES if name not in random), *random):
        policies = [who for who in POLICIES if who not in COSTLY or name not in random[paths:]]
        yield from ((name, who) for who in (*problems.published(name), *policies))


def run(problem: str, who: str) -> Run:
    """Plays a policy on a path, or scores the initial trajectory of a method."""
    return _scored(problem, who) if who in problems.METHODS else _played(problem, who)


def _scored(problem: str, method: str) -> Run:
    """The joint path as it was published, by kinematics alone: nobody has moved an arm along it."""
    scenario = scenarios.get(problem)
    joints = problems.trajectory(problem, method)
    return Run(problem, method, fingerprint(scenario), followed(scenario.arm, joints, problems.waypoints(problem)))


def _played(problem: str, policy: str) -> Run:
    scenario, waypoints = scenarios.get(problem), problems.waypoints(problem)
    with threadpool_limits(limits=1):
        episode = rollout(scenario, registry.make(policy, scenario), seed=0)
    q = np.vstack([scenario.first_q(scenario.trajectory), episode.q])[waypoint_steps(len(waypoints.positions))]
    held = (episode.at_limit > 0).sum(axis=0)
    return Run(
        problem,
        policy,
        fingerprint(scenario),
        followed(scenario.arm, q, waypoints),
        at_stop=int(held[0]),
        at_velocity_limit=int(held[1]),
        status=Status(int(episode.status.max())).label,
        time_p50_us=round(float(np.median(episode.time_ns[1:])) / 1e3, 1),
    )
