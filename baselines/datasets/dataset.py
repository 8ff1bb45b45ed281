"""Plays episodes and writes them as a data set of Minari, with where they come from."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
import sys
from collections.abc import Iterator, Sequence
from typing import Any

import gymnasium as gym
import h5py  # noqa: F401  # Minari's own message about it does not say which extra brings it
import minari
import numpy as np
from gymnasium.envs.registration import EnvSpec
from minari.data_collector import EpisodeBuffer
from minari.dataset.minari_dataset import parse_dataset_id
from minari.dataset.minari_storage import MinariStorage
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from baselines.datasets.folder import Folder
from baselines.datasets.record import Block, blocks, record
from baselines.episodes import add_up
from baselines.evaluation.entrants import AnyPolicy
from baselines.evaluation.machine import describe
from baselines.evaluation.plan import Job, make_plan
from baselines.files.locks import locked
from baselines.fingerprints import fingerprint
from ikgym import scenarios
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.scenarios import Preview, Scenario
from ikgym.spaces import action_space, observation_space

#: The environment, named so that whoever has it back needs no import.
ENVIRONMENT = "ikgym:RedundantIK-v0"


@dataclasses.dataclass(frozen=True)
class DataSet:
    """What is to be written.

    Args:
        jobs: An episode each, of one policy in one scenario.
        about: Where they come from, as JSON has it: scenario and its fingerprint, policy and its parameters, split,
            episodes, preview and versions.
    """

    jobs: tuple[Job, ...]
    about: dict[str, Any]


def planned(
    scenario: str | Scenario,
    policy: AnyPolicy,
    *,
    episodes: int,
    split: str = "train",
    preview: Preview | None = None,
    trust: bool = False,
) -> DataSet:
    """A data set, checked before anything is played.

    Args:
        scenario: What is tracked, see :func:`ikgym.scenarios.find`.
        policy: Who tracks it, see :func:`baselines.evaluation.entrants.entrants`.
        episodes: The first so many seeds of the split.
        split: See :data:`ikgym.scenarios.SPLITS`.
        preview: Steps ahead that are shown; what the policy asks for if left out.
        trust: Whether the file of an agent may run code.

    Raises:
        UnknownNameError: There is no such scenario, policy, parameter or split.
        InvalidInputError: A value is out of range, the policy does not suit the scenario, or there are no episodes
            that differ, or they have to be played one after the other.
    """
    if policy == "all" or scenario == "all":
        raise InvalidInputError("A data set is of one policy in one scenario, got all of them.")
    plan = make_plan([scenario], [policy], episodes=episodes, split=split, preview=preview, trust=trust)
    first = plan.jobs[0]
    if len(plan.jobs) < episodes:
        raise InvalidInputError(
            f"{first.scenario.name} is the same at every reset: expected one episode, got episodes={episodes}."
        )
    if any(job.before for job in plan.jobs):
        raise InvalidInputError(
            f"{first.scenario.name} is played in sequences of episodes, whose policies learn from those before; a data "
            "set has episodes that stand for themselves."
        )
    about = {
        "scenario": first.scenario.name,
        "fingerprint": first.fingerprint,
        "policy": first.policy,
        "parameters": dict(first.parameters),
        "split": split,
        "episodes": episodes,
        "preview": list(first.preview) if isinstance(first.preview, Sequence) else first.preview,
        "versions": {name: describe()[name] for name in ("ikgym", "python", "numpy", "numba")},
    }
    return DataSet(plan.jobs, about)


def write(
    wanted: DataSet, out: pathlib.Path, *, resume: bool = False, overwrite: bool = False, progress: bool = False
) -> None:
    """Plays the episodes block by block, and puts them together when all are there.

    A process that is killed leaves the blocks that it has written; a data set that can be read is complete.

    Args:
        wanted: See :func:`planned`.
        out: The folder. Its name is what Minari knows the data set by, such as ``dls-v0``.
        resume: Goes on with what is in the folder.
        overwrite: Replaces the data set in the folder.
        progress: Whether to show a bar on stderr.

    Raises:
        InvalidInputError: The name of the folder is none for Minari; a policy chooses no action.
        ResultsError: The folder cannot be written, or has something else.
    """
    called = _checked_name(out)
    with locked(out):
        folder = Folder(out)
        folder.prepare(wanted.about, resume=resume, overwrite=overwrite)
        if folder.complete:
            folder.tidy()
            return
        parts = blocks(wanted.jobs)
        _play(parts, folder, progress=progress)
        with contextlib.suppress(InvalidInputError):  # a trajectory of somebody's own class, which no file can hold
            wanted.jobs[0].scenario.save(folder.scenario)
        with folder.completing() as data:
            _put_together(wanted, called, parts, folder, data)


def _checked_name(out: pathlib.Path) -> str:
    """What Minari calls the data set.

    Raises:
        InvalidInputError: It would not find it by that name.
    """
    name = out.resolve().name
    try:
        parse_dataset_id(name)
    except (ValueError, TypeError):
        raise InvalidInputError(
            f"out: expected a folder with a name that Minari knows, letters, digits, - and _ with a version behind, "
            f"such as dls-v0; got {name!r}."
        ) from None
    return name


def _play(parts: Sequence[Sequence[Job]], folder: Folder, *, progress: bool) -> None:
    left = [(number, jobs) for number, jobs in enumerate(parts) if not folder.has(number)]
    steps = sum(job.scenario.steps for _, jobs in left for job in jobs)
    with tqdm(
        total=steps,
        disable=not progress,
        file=sys.stderr,
        unit="step",
        unit_scale=True,
        dynamic_ncols=True,
        mininterval=0.1 if sys.stderr.isatty() else 10.0,  # a log file has no cursor to go back with
    ) as bar:
        for number, jobs in left:
            with threadpool_limits(limits=1):  # the matrices of an arm are too small to share out
                folder.add(number, record(jobs, bar.update))


def _put_together(
    wanted: DataSet, called: str, parts: Sequence[Sequence[Job]], folder: Folder, data: pathlib.Path
) -> None:
    job = wanted.jobs[0]
    preview: Any = job.preview
    storage = MinariStorage.new(
        data.absolute(),  # of a relative path Minari makes another one when it adds up sizes
        observation_space=observation_space(job.scenario, preview, job.make().commands),
        action_space=action_space(job.scenario),
        env_spec=_env_spec(job),
    )
    metadatas: list[dict[str, Any]] = []
    storage.update_episodes(_episodes(parts, folder, metadatas))
    storage.update_episode_metadata(metadatas)
    parameters = ",".join(f"{name}={value!r}" for name, value in job.parameters.items())
    storage.update_metadata(
        {
            "dataset_id": called,
            "minari_version": minari.__version__,
            "algorithm_name": f"{job.policy}:{parameters}" if parameters else job.policy,
            "description": f"{wanted.about['episodes']} episodes of {job.policy} in {job.scenario.name}.",
            "ikgym": {**wanted.about, "machine": describe()},
        }
    )


def _episodes(
    parts: Sequence[Sequence[Job]], folder: Folder, metadatas: list[dict[str, Any]]
) -> Iterator[EpisodeBuffer]:
    """The episodes of all blocks, one block in memory at a time; what is known of each goes into the list."""
    for number, jobs in enumerate(parts):
        block = folder.read(number)
        costs = [add_up(block[key]) for key in ("infos/tracking_cost", "infos/velocity_cost")]
        totals = add_up(-block["rewards"])
        for row, job in enumerate(jobs):
            metadatas.append(
                {
                    "total_cost": totals[row],
                    "tracking_cost": costs[0][row],
                    "velocity_cost": costs[1][row],
                    **({} if job.arm_seed is None else {"arm_seed": job.arm_seed}),
                }
            )
            yield _episode(block, row, job.seed)


def _episode(block: Block, row: int, seed: int) -> EpisodeBuffer:
    parts: dict[str, Any] = {}
    for key, values in block.items():
        first, _, rest = key.partition("/")
        if rest:
            parts.setdefault(first, {})[rest] = values[row]
        else:
            parts[first] = values[row]
    steps = len(parts["rewards"])
    return EpisodeBuffer(
        seed=seed,
        **parts,
        terminations=np.zeros(steps, dtype=np.bool_),
        truncations=np.arange(steps) == steps - 1,
    )


def _env_spec(job: Job) -> EnvSpec | None:
    """What Minari makes the environment from again; None where no registered name stands for the scenario."""
    name = job.scenario.name
    try:
        registered = fingerprint(scenarios.get(name)) == job.fingerprint
    except IkgymError:
        registered = False
    if not registered:
        return None
    return gym.make(ENVIRONMENT, scenario=name, preview=job.preview, commands=job.make().commands).spec
