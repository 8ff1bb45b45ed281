"""Learned agents as policies."""

from __future__ import annotations

import abc
import dataclasses
import os
import pathlib
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from baselines.agents import files, untrusted
from baselines.agents.protocols import AgentFile
from baselines.agents.view import AgentView
from baselines.files import ResultsError
from baselines.fingerprints import arm_fingerprint
from baselines.policy import Batch, Memory, Problem, Solution, statuses
from baselines.solvers.wrappers import orientation
from baselines.status import Status
from baselines.wrapper import Wrapper
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.preview import offsets as checked_offsets
from ikgym.scenarios import Preview


@dataclasses.dataclass(frozen=True, eq=False)
class LearnedPolicy(Wrapper, abc.ABC):
    """A network between the features of an observation and an action, perhaps on top of a base policy.

    It plays every scenario of its arm whose features have the shape of those that it was trained on. The
    base policy sees what it would see alone, and has its memory in that of the agent: a network output of 0 is the
    base policy, bit for bit. The status is that of the base policy, at best ``applied``.

    Its preview is a tuple of steps ahead. Observations that show 1, 2, … up to the furthest of them do, too. An agent
    that was trained on whole poses plays scenarios that show skew coordinates, too: their 90° ambiguity is resolved by
    :func:`baselines.solvers.wrappers.orientation.resolve_orientation`, which takes all steps up to the furthest.

    Args:
        problem: What the policy is told of the scenario.

    Raises:
        ResultsError: There is no such file, or it cannot be used.
        InvalidInputError: The scenario does not fit the agent, or the base policy.
    """

    #: What was read.
    file: AgentFile = dataclasses.field(init=False, repr=False)
    #: What it sees of the problem, or of that of whole poses.
    view: AgentView = dataclasses.field(init=False, repr=False)

    grain: ClassVar[int] = 32
    from_file: ClassVar[bool] = True

    def __post_init__(self) -> None:
        file = self.load()
        problem = _problem_for(file, self.problem)
        _check_size(file, problem)
        if not self._takes_any_arm:
            check_arm(file.source, file.about, problem)
        try:
            view = AgentView.of(file.processing, problem)
        except UnknownNameError as e:
            raise ResultsError(f"Agent {file.source} cannot be used: {e}") from None
        except InvalidInputError as e:
            raise InvalidInputError(f"Agent {file.source}: {e}") from None
        for field, value in {"file": file, "view": view, "inner": view.base}.items():
            object.__setattr__(self, field, value)

    @abc.abstractmethod
    def load(self) -> AgentFile:
        """Reads the file.

        Raises:
            ResultsError: There is no such file, or it cannot be used.
        """

    @property
    def _takes_any_arm(self) -> bool:
        """Whether it may play on an arm that it was not trained for."""
        return False

    @property
    def preview(self) -> Preview:
        """The steps ahead that are seen, or how many there are up to the furthest."""
        return self.view.preview.furthest if self._resolves else self.view.preview.shown

    @property
    def _resolves(self) -> bool:
        """Whether the agent knows whole poses, and the scenario shows skew coordinates."""
        return self.view.problem is not self.problem

    def own_memory(self, rows: int) -> Memory:
        """That of the orientation where its ambiguity is resolved."""
        return orientation.start_memory(rows) if self._resolves else ()

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        own, inside = self.split(memory)
        if self._resolves:
            batch, own = orientation.resolve_orientation(self.problem, batch, own)
        fractions, step = self.view.act(batch, inside, self.file.network)
        qdot = fractions * self.problem.velocity_limit
        if step is None:
            return Solution(qdot, own, statuses(len(qdot)), np.ones(len(qdot), dtype=np.int64))
        # Where the base policy has converged, its action with a correction has not.
        status = np.maximum(step.status, int(Status.APPLIED))
        return self.solution(qdot, own, step._replace(status=status))


@dataclasses.dataclass(frozen=True, eq=False)
class Agent(LearnedPolicy):
    """An agent from a file: one of ours (`.safetensors`), or a model of Stable-Baselines3 (`.zip`).

    Reading one of ours runs nothing that is in it. A model needs `trust`: Stable-Baselines3 loads it then, and runs
    whatever code is in the file.

    Args:
        problem: What the policy is told of the scenario.
        path: The file.
        trust: Whether a model may run its own code. Only for files whose maker you know; no file can grant it.
        offsets: Steps ahead at which a model sees the nominal coordinates that was trained on the observation itself;
            1, 2, … if left out, as its file does not tell. Files that do tell are not to be contradicted.
        hash: The first twelve digits of the agent's hash, to insist on; in results those of the agent that played.
        any_arm: Whether it may play on an arm that it was not trained for, which is refused otherwise.

    Raises:
        ResultsError: There is no such file, it is damaged, or needs to be trusted.
        InvalidInputError: A parameter is refused, or the scenario does not fit the agent.
    """

    path: str = ""
    trust: bool = False
    offsets: tuple[int, ...] | None = None
    hash: str | None = None
    any_arm: bool = False

    name: ClassVar[str] = "agent"
    nameless: ClassVar[str] = "path"
    decisive: ClassVar[tuple[str, ...]] = ("path", "trust")

    def __post_init__(self) -> None:
        if not isinstance(self.path, (str, os.PathLike)) or not os.fspath(self.path):
            raise ResultsError(f"agent: expected the path of its file, as in agent:PATH, got {self.path!r}.")
        for option in ("trust", "any_arm"):
            if not isinstance(getattr(self, option), bool):
                raise InvalidInputError(f"{option}: expected True or False, got {getattr(self, option)!r}.")
        if self.offsets is not None:
            object.__setattr__(self, "offsets", checked_offsets(self.offsets))
        object.__setattr__(self, "path", os.fspath(self.path))
        super().__post_init__()
        digits = self.file.digits
        if self.hash is not None and (not isinstance(self.hash, str) or self.hash != digits):
            raise InvalidInputError(f"hash: expected {digits}, which {self.path} has, got {self.hash!r}.")
        object.__setattr__(self, "hash", digits)

    @property
    def _takes_any_arm(self) -> bool:
        return self.any_arm

    def load(self) -> AgentFile:
        """See :meth:`LearnedPolicy.load`."""
        try:
            file = pathlib.Path(self.path).expanduser()
        except RuntimeError:
            raise ResultsError(f"Agent {self.path}: expected a path, got one with an unknown user's home.") from None
        if file.suffix == untrusted.ZIP:
            untrusted.check_trust(file, trust=self.trust)
            # Only these files need a learning library.
            from baselines.agents import sb3_zip

            return sb3_zip.load_zip(file, self.problem, trust=self.trust, offsets=self.offsets)
        if self.offsets is not None:
            raise InvalidInputError(f"offsets: {self.path} says itself what it sees, got {self.offsets}.")
        return files.load_agent(file)


def _problem_for(file: AgentFile, problem: Problem) -> Problem:
    """The problem as the agent knows it."""
    trained = file.about.get("task", {}).get("name")
    return orientation.full_problem(problem) if (trained, problem.task.name) == ("pose", "skew") else problem


def _check_size(file: AgentFile, problem: Problem) -> None:
    """Refuses a scenario whose features have another shape."""
    n, task = problem.model.joints, problem.task
    trained = file.about.get("joints", n), file.about.get("task", {"size": task.size, "error_size": task.error_size})
    sizes = trained[0], trained[1]["size"], trained[1]["error_size"]
    here = n, task.size, task.error_size
    if sizes != here:
        words = "{} joints and {} task coordinates with {} components of the error"
        raise InvalidInputError(
            f"Agent {file.source} was trained for {words.format(*sizes)}; here there are {words.format(*here)}."
        )
    shape, needed = (
        (file.network.inputs, file.network.outputs),
        (file.processing.size(problem), file.processing.outputs(problem)),
    )
    if shape != needed:
        raise InvalidInputError(
            f"Agent {file.source}: expected a network from {needed[0]} features to {needed[1]} outputs, got "
            f"{shape[0]} and {shape[1]}."
        )


def check_arm(source: str, about: Mapping[str, Any], problem: Problem) -> None:
    """Refuses an arm that moves differently from the one that the agent was trained for, where its file says which.

    Args:
        source: The file, as messages name it.
        about: What it says of the agent.
        problem: What the agent is told of the scenario.

    Raises:
        InvalidInputError: The arm is another one.
    """
    trained, here = _trained_arm(about), arm_fingerprint(problem.model)
    if trained is not None and trained["fingerprint"] != here:
        raise InvalidInputError(
            f"Agent {source} was trained for the arm {trained['name']}, which moves differently from "
            f"{problem.model.name}: expected that arm, or any_arm=True, as in agent:path=FILE,any_arm=True."
        )


def _trained_arm(about: Mapping[str, Any]) -> Mapping[str, str] | None:
    """Name and fingerprint of the arm; of older files that of the scenario of that name, None where there is none."""
    if "arm" in about:
        arm: Mapping[str, str] = about["arm"]
        return arm
    name = about.get("scenario", {}).get("name")
    if name not in scenarios.names():
        return None
    model = scenarios.get(name).model
    return {"name": model.name, "fingerprint": arm_fingerprint(model)}
