"""Learned agents as policies."""

from __future__ import annotations

import abc
import dataclasses
import functools
import os
import pathlib
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from baselines.agents import files
from baselines.agents.base_policy import Outlook, policy_under, refuse_to_be_named
from baselines.agents.parts import AgentFile
from baselines.files import ResultsError
from baselines.policy import Batch, Memory, Operations, Problem, Solution, SolverPolicy, statuses
from baselines.solvers.wrappers import orientation
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.scenarios import Preview
from ikgym.simulator import offsets as checked_offsets
from ikgym.validation import FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class LearnedPolicy(SolverPolicy, abc.ABC):
    """A network between the features of an observation and an action, perhaps on top of another policy.

    It plays every scenario whose features have the shape of those that it was trained on, be it another one. The
    policy under it sees what it would see alone, and has its memory in that of the agent: an answer of 0 is that
    policy, bit for bit.

    Its preview is a tuple of steps ahead. Observations that show 1, 2, … up to the furthest of them do, too. An agent
    that was trained on whole poses plays scenarios that show skew coordinates, too: they are unfolded, see
    :func:`baselines.solvers.wrappers.orientation.unfold`, which takes all steps up to the furthest.

    Args:
        problem: What the policy is told of the scenario.

    Raises:
        ResultsError: There is no such file, or it cannot be used.
        InvalidInputError: The scenario does not fit the agent, or the policy under it.
    """

    #: What was read.
    file: AgentFile = dataclasses.field(init=False, repr=False)
    #: The policy under the agent.
    base: SolverPolicy | None = dataclasses.field(init=False, repr=False)
    #: What the agent and the policy under it are told: the problem, or that of whole poses.
    told: Problem = dataclasses.field(init=False, repr=False)

    grain: ClassVar[int] = 32
    composed: ClassVar[bool] = True

    def __post_init__(self) -> None:
        refuse_to_be_named()
        file = self.load()
        told = _told(file, self.problem)
        _check_size(file, told)
        try:
            base = policy_under(file.processing, told)
        except UnknownNameError as e:
            raise ResultsError(f"Agent {file.source} cannot be used: {e}") from None
        except InvalidInputError as e:
            raise InvalidInputError(f"Agent {file.source}: {e}") from None
        for field, value in {"file": file, "base": base, "told": told}.items():
            object.__setattr__(self, field, value)

    @abc.abstractmethod
    def load(self) -> AgentFile:
        """Reads the file.

        Raises:
            ResultsError: There is no such file, or it cannot be used.
        """

    @property
    def preview(self) -> Preview:
        """The steps ahead that are seen, or how many there are up to the furthest."""
        return self.outlook.furthest if self._unfolds else self.outlook.preview

    @functools.cached_property
    def outlook(self) -> Outlook:
        """What the agent and the policy under it see."""
        return Outlook.of(self.file.processing, self.base)

    @property
    def _unfolds(self) -> bool:
        return self.told is not self.problem

    def memory(self, rows: int) -> Memory:
        """That of the policy under the agent, and before it that of the unfolding where there is one."""
        return *(orientation.memory(rows) if self._unfolds else ()), *(self.base.memory(rows) if self.base else ())

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        if not self._unfolds:
            return self._answer(batch, memory)
        seen, kept = orientation.unfold(self.problem, batch, memory[:2])
        solution = self._answer(seen, memory[2:])
        return solution._replace(memory=(*kept, *solution.memory))

    def _answer(self, batch: Batch, memory: Memory) -> Solution:
        """The solution for what the agent is told."""
        processing = self.file.processing
        base: FloatArray | None = None
        if self.base is None:
            kept: Memory = ()
            status, iterations = statuses(len(batch.q)), np.ones(len(batch.q), dtype=np.int64)
        else:
            # Not its solve, so that what is not finite or beyond the limit is dealt with as if it were alone.
            shown = batch._replace(nominal=self.outlook.of_policy(batch.nominal))
            action, (status, iterations, *inside) = self.base.act(shown, memory)
            base, kept = action.astype(np.float64), tuple(inside)
        batch = batch._replace(nominal=self.outlook.of_agent(batch.nominal))
        features = processing.features(self.told, batch, base)
        fractions = processing.action(self.told, batch, self.file.network.answer(features), base)
        return Solution(fractions * self.problem.velocity_limit, kept, status, iterations)

    def operations(self, state: Memory) -> Operations:
        """Those of the policy under the agent, which may keep count in its memory."""
        return (
            super().operations(state)
            if self.base is None
            else self._counted(self.base.operations(self._inner_state(state)))
        )

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """What the policy under the agent shows of itself."""
        return {} if self.base is None else self.base.diagnostics(self._inner_state(state))

    def _inner_state(self, state: Memory) -> Memory:
        """The state of the policy under the agent."""
        return (*state[:2], *state[4:]) if self._unfolds else state

    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """Those of the policy under the agent, or a measurement; what a projector into the null space takes."""
        return self._counted((0, 0, 0, 1) if self.base is None else self.base.count(iterations))

    def _counted(self, counts: Iterable[Any]) -> Operations:
        """With a Jacobian and a factorisation more where answers go through the null space, a pose where it unfolds."""
        forwards, jacobians, factorisations, measurements = map(np.asarray, counts)
        more, pose = int(self.file.processing.null_space is not None), int(self._unfolds)
        return Operations(forwards + pose, jacobians + more, factorisations + more, measurements)


@dataclasses.dataclass(frozen=True, eq=False)
class Agent(LearnedPolicy):
    """An agent from a file: one of ours (`.safetensors`), or a model of Stable-Baselines3 (`.zip`).

    Reading runs nothing that is in the file. A model is rebuilt from its names, numbers and plain texts, if it is a
    multi-layer perceptron of PPO, A2C, SAC, TD3 or DDPG, see :mod:`baselines.agents.sb3_zip`; with `trust` it is loaded
    by Stable-Baselines3, whatever it is and does.

    Args:
        problem: What the policy is told of the scenario.
        path: The file.
        trust: Whether a model may run its own code. Only for files whose maker you know.
        offsets: Steps ahead at which a model sees the nominal coordinates that was trained on the observation itself;
            1, 2, … if left out, as its file does not tell. Files that do tell are not to be contradicted.
        hash: The first twelve digits of the agent's hash, to insist on; in results those of the agent that played.

    Raises:
        ResultsError: There is no such file, it is damaged, or needs to be trusted.
        InvalidInputError: A parameter is refused, or the scenario does not fit the agent.
    """

    path: str = ""
    trust: bool = False
    offsets: tuple[int, ...] | None = None
    hash: str | None = None

    name: ClassVar[str] = "agent"
    nameless: ClassVar[str] = "path"
    decisive: ClassVar[tuple[str, ...]] = ("path", "trust")

    def __post_init__(self) -> None:
        if not isinstance(self.path, (str, os.PathLike)) or not os.fspath(self.path):
            raise ResultsError(f"agent: expected the path of its file, as in agent:PATH, got {self.path!r}.")
        if not isinstance(self.trust, bool):
            raise InvalidInputError(f"trust: expected True or False, got {self.trust!r}.")
        if self.offsets is not None:
            object.__setattr__(self, "offsets", checked_offsets(self.offsets))
        object.__setattr__(self, "path", os.fspath(self.path))
        super().__post_init__()
        digits = self.file.digits
        if self.hash not in (None, digits):
            raise InvalidInputError(f"hash: expected {digits}, which {self.path} has, got {self.hash!r}.")
        object.__setattr__(self, "hash", digits)

    def load(self) -> AgentFile:
        """See :meth:`LearnedPolicy.load`."""
        file = pathlib.Path(self.path).expanduser()
        if file.suffix == ".zip":
            # Only these files need a learning library.
            from baselines.agents import sb3_zip

            return sb3_zip.load_zip(file, self.problem, trust=self.trust, offsets=self.offsets)
        if self.offsets is not None:
            raise InvalidInputError(f"offsets: {self.path} says itself what it sees, got {self.offsets}.")
        return files.load_agent(file)


def _told(file: AgentFile, problem: Problem) -> Problem:
    """The problem as the agent knows it."""
    trained = file.about.get("task", {}).get("name")
    return orientation.whole(problem) if (trained, problem.task.name) == ("pose", "skew") else problem


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
    shape, needed = (file.network.inputs, file.network.outputs), (file.processing.size(problem), n)
    if shape != needed:
        raise InvalidInputError(
            f"Agent {file.source}: expected a network from {needed[0]} features to {needed[1]} joints, got "
            f"{shape[0]} and {shape[1]}."
        )
