"""Learned agents as policies."""

from __future__ import annotations

import dataclasses
import os
import pathlib
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.agents.files import AgentFile, load_agent
from baselines.agents.processing import Held
from baselines.files import ResultsError
from baselines.fingerprints import arm_fingerprint
from baselines.policy import Batch, Memory, Problem, Solution, SolverPolicy, statuses
from baselines.solvers.quadratic_program.velocity_box import velocity_box
from baselines.solvers.wrappers import full_orientation
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.jit import kernel
from ikgym.scenarios import Preview
from ikgym.validation import Bounds, Flag, FloatArray

#: The agents that come with the package.
FOLDER = pathlib.Path(__file__).parents[1] / "data" / "agents"


class AgentMemory(NamedTuple):
    """Memory of an agent: a :class:`Held`, then an :class:`OrientationMemory`, used where skew coordinates are shown.

    Attributes:
        values: See :class:`Held`. Shape (B, k).
        left: See :class:`Held`. Shape (B,).
        cosines: See :class:`OrientationMemory`. Shape (B, 2).
        known: See :class:`OrientationMemory`. Shape (B,).
    """

    values: FloatArray
    left: npt.NDArray[np.int64]
    cosines: FloatArray
    known: npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True, eq=False)
class LearnedPolicy(SolverPolicy):
    """A network between the features of an observation and an action.

    It plays every scenario of its arm with the same number of features and outputs. Its preview is a
    tuple of steps ahead; observations that show 1, 2, … up to the furthest of them are accepted, too. An agent trained
    on whole poses also plays scenarios that show skew coordinates: their orientation is resolved by
    :func:`baselines.solvers.wrappers.full_orientation.resolve_orientation`, which needs all steps up to the furthest.

    Args:
        problem: The part of the scenario that the policy knows.
        interval: Steps from one evaluation of the network to the next; that of its training if left out. The
            output of the network is held in between, with feedback in every step.
    """

    interval: Annotated[int, Bounds(at_least=1)] | None = None
    #: The agent in the file.
    file: AgentFile = dataclasses.field(init=False, repr=False)
    #: The problem as the agent sees it: with whole poses if it was trained on them.
    seen: Problem = dataclasses.field(init=False, repr=False)
    #: Limits that actions keep, see :func:`keep_rows`; None if the arm has none, or the agent ignores them.
    limits: FloatArray | None = dataclasses.field(init=False, repr=False)

    keeps_acceleration: ClassVar[bool] = True
    grain: ClassVar[int] = 32

    def _take(self, file: AgentFile, *, any_arm: bool = False) -> None:
        """Uses the agent of a file.

        Args:
            file: The file.
            any_arm: Whether it may control an arm that it was not trained for.

        Raises:
            InvalidInputError: The scenario does not fit the agent.
        """
        skew = (file.about["task"]["name"], self.problem.task.name) == ("pose", "skew")
        seen = full_orientation.full_problem(self.problem) if skew else self.problem
        check_scenario(file, seen, any_arm=any_arm)
        processing = file.processing
        try:
            needed = processing.size(seen), processing.outputs(seen)
        except InvalidInputError as e:
            raise InvalidInputError(f"Agent {file.source}: {e}") from None
        shape = file.network.sizes[0], file.network.sizes[-1]
        if shape != needed:
            raise InvalidInputError(
                f"Agent {file.source}: expected a network from {needed[0]} features to {needed[1]} outputs, got "
                f"{shape[0]} and {shape[1]}."
            )
        limits = seen.limits if processing.bounded and seen.model.limited else None
        self._settle(file=file, seen=seen, limits=limits, interval=self.interval or processing.interval)

    @property
    def preview(self) -> Preview:
        """The steps ahead that the agent sees, or their number up to the furthest."""
        return self._offsets[-1] if self._resolves else self._offsets

    @property
    def _offsets(self) -> tuple[int, ...]:
        return self.file.processing.steps(self.seen)

    @property
    def _resolves(self) -> bool:
        """Whether the scenario shows skew coordinates to an agent for whole poses."""
        return self.seen is not self.problem

    def memory(self, rows: int) -> Memory:
        """Nothing held, and an evaluation of the network due."""
        processing = self.file.processing
        held = Held(np.zeros((rows, processing.held_size(self.seen))), np.zeros(rows, dtype=np.int64))
        return AgentMemory(*held, *full_orientation.start_memory(rows))

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        assert isinstance(memory, AgentMemory)
        held = Held(memory.values.copy(), memory.left.copy())
        orientation = full_orientation.OrientationMemory(memory.cosines, memory.known)
        if self._resolves:
            batch, orientation = full_orientation.resolve_orientation(self.problem, batch, orientation)
            batch = batch._replace(nominal=batch.nominal.take(np.array(self._offsets) - 1, axis=1))
        processing, network = self.file.processing, self.file.network
        assert self.interval is not None
        fractions = processing.act(self.seen, batch, network, self.interval, held)
        if self.limits is not None:
            keep_rows(self.limits, self.seen.dt, self.seen.velocity_limit, batch.q, batch.qdot, fractions)
        rows = len(fractions)
        after = AgentMemory(*held, *orientation)
        return Solution(fractions * self.problem.velocity_limit, after, statuses(rows), np.ones(rows, dtype=np.int64))


@dataclasses.dataclass(frozen=True, eq=False)
class Agent(LearnedPolicy):
    """An agent from a file, ``agent:FILE.safetensors``.

    Args:
        problem: The part of the scenario that the policy knows.
        path: The file.
        hash: The first twelve digits of the agent's hash; another agent is refused. Results contain the actual ones.
        any_arm: Whether it may control an arm that it was not trained for.
        interval: See :class:`LearnedPolicy`.
        given: An agent in memory, in place of a file.

    Raises:
        ResultsError: The file cannot be read.
        InvalidInputError: A parameter is refused, or the scenario does not fit the agent.
    """

    path: str | os.PathLike[str] = ""
    hash: str | None = None
    any_arm: Flag = False
    given: dataclasses.InitVar[AgentFile | None] = dataclasses.field(default=None, kw_only=True)

    name: ClassVar[str] = "agent"
    positional: ClassVar[str] = "path"
    decisive: ClassVar[tuple[str, ...]] = ("path",)

    def __post_init__(self, given: AgentFile | None) -> None:
        super().__post_init__()
        file = given or agent_at(self.path, self.hash)
        self._take(file, any_arm=self.any_arm)
        self._settle(path=os.fspath(self.path), hash=file.digits)


@dataclasses.dataclass(frozen=True, eq=False)
class AgentAlone(LearnedPolicy):
    """Learned agent that comes with the package, trained on `varga7-random` by apg.

    Args:
        problem: The part of the scenario that the policy knows.
        hash: The first twelve digits of its hash, which distinguishes its results from those of a successor.
        interval: See :class:`LearnedPolicy`. On validation episodes 8, as in the training, cost 0.3 % (0.2 to 0.5 %)
            more than 1.

    Raises:
        InvalidInputError: The file has another hash, or the scenario does not fit the agent.
    """

    hash: str = "25357e60147d"

    name: ClassVar[str] = "agent_alone"

    def __post_init__(self) -> None:
        super().__post_init__()
        file = agent_at(FOLDER / f"{self.name}.safetensors", self.hash)
        self._take(dataclasses.replace(file, source=self.name))


@dataclasses.dataclass(frozen=True, eq=False)
class AgentTrack(AgentAlone):
    """Learned agent that comes with the package, trained in `ikgym/Track-v0` by TD3.

    Args:
        problem: The part of the scenario that the policy knows.
        hash: The first twelve digits of its hash, which distinguishes its results from those of a successor.
        interval: See :class:`LearnedPolicy`.

    Raises:
        InvalidInputError: The file has another hash, or the scenario does not fit the agent.
    """

    hash: str = "39fe95f6b3c5"

    name: ClassVar[str] = "agent_track"


def agent_at(path: str | os.PathLike[str], digits: str | None) -> AgentFile:
    """The agent of a file.

    Args:
        path: The file; ``~`` is the home of the user.
        digits: The first digits of its hash; None for any.

    Raises:
        ResultsError: The file cannot be read.
        InvalidInputError: Its hash is another one.
    """
    if not isinstance(path, (str, os.PathLike)) or not os.fspath(path):
        raise ResultsError(f"path: expected the file of an agent, got {path!r}.")
    agent = load_agent(pathlib.Path(os.path.expanduser(path)))  # noqa: PTH111  # never raises, unlike Path's
    if digits is not None and not (isinstance(digits, str) and digits == agent.digits):
        raise InvalidInputError(f"hash: expected {agent.digits}, the hash of {path}, got {digits!r}.")
    return agent


def check_scenario(agent: AgentFile, problem: Problem, *, any_arm: bool) -> None:
    """Refuses a scenario with another number of joints, another task or another arm than the agent was trained for.

    Args:
        agent: The agent.
        problem: The problem of the scenario.
        any_arm: Whether it may control another arm.

    Raises:
        InvalidInputError: The scenario does not fit the agent.
    """
    about, model, task = agent.about, problem.model, problem.task
    trained = about["joints"], about["task"]["size"], about["task"]["error_size"]
    here = model.joints, task.size, task.error_size
    if trained != here:
        words = "{} joints and {} task coordinates with {} components of the error"
        raise InvalidInputError(
            f"Agent {agent.source} was trained for {words.format(*trained)}; here there are {words.format(*here)}."
        )
    if not any_arm and about["arm"]["fingerprint"] != arm_fingerprint(model):
        raise InvalidInputError(
            f"Agent {agent.source} was trained for the arm {about['arm']['name']}, which moves differently from "
            f"{model.name}: expected that arm, or any_arm=True, as in agent:path=FILE,any_arm=True."
        )


@kernel
def keep_rows(limits, dt, velocity_limit, q, last, action):
    """Bounds actions, row by row, as those of the policy `qp`: a joint brakes ahead of its stop. NaN stays NaN.

    Args:
        limits: See :class:`baselines.policy_kernels.Model`. Shape (5, n).
        dt: Δt in [s].
        velocity_limit: Shape (n,).
        q: Shape (B, n).
        last: Joint velocities last applied. Shape (B, n).
        action: Fractions of the velocity limit, changed in place. Shape (B, n).
    """
    n = q.shape[1]
    lower, upper = np.empty(n), np.empty(n)
    for row in range(q.shape[0]):
        velocity_box(limits, dt, q[row], last[row], lower, upper)
        for j in range(n):
            share = action[row, j]
            if share * velocity_limit[j] > upper[j]:
                action[row, j] = upper[j] / velocity_limit[j]
            elif share * velocity_limit[j] < lower[j]:
                action[row, j] = lower[j] / velocity_limit[j]
