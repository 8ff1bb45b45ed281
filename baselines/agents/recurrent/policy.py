"""Agents with memory as policies."""

import dataclasses
import os
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.agents.files import AgentFile
from baselines.agents.network import Singles
from baselines.agents.policy import FOLDER, agent_at, check_scenario
from baselines.agents.recurrent.kernels import filter_rows
from baselines.agents.recurrent.network import GatedNetwork
from baselines.agents.recurrent.processing import Recurrent
from baselines.policy import Batch
from baselines.solvers.adaptive.corrected import Corrected, Measurement
from baselines.spec import parse_policy
from baselines.wrapper import policies_in
from ikgym.exceptions import InvalidInputError
from ikgym.kernels import tasks as task_kernels
from ikgym.validation import FloatArray, flag

#: The agent that comes with the package.
SHIPPED = "agent_memory"


class RecurrentMemory(NamedTuple):
    """Estimates of the arm and of its sensors.

    Attributes:
        before: See :class:`Measurement`. Shape (B, h, n).
        age: See :class:`Measurement`. Shape (B, 1).
        rest: Changes of the estimates that are not blended in yet. Shape (B, 6).
        parameters: See :mod:`baselines.solvers.adaptive.chain_parameters`. Shape (B, p).
        covariance: The covariance of their errors. Shape (B, p, p).
        hidden: The hidden state of the network. Shape (B, units).
        since: Steps since the last measurement that was used. Shape (B,).
    """

    before: FloatArray
    age: FloatArray
    rest: FloatArray
    parameters: FloatArray
    covariance: FloatArray
    hidden: Singles
    since: npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, eq=False)
class RecurrentPolicy(Corrected):
    """Corrects a base policy by a Kalman filter that a recurrent network tunes.

    The filter is that of :class:`baselines.solvers.adaptive.calibrated.Calibrated`, without its settings: at each
    measurement a gated recurrent network sees the innovation and estimates the noise of position and orientation, and
    the change of joint zeros since the last measurement (after KalmanNet, Revach et al. 2022, whose network gives the
    gain). It was trained on randomly drawn plants.

    Args:
        problem: The part of the scenario that the policy knows.
        path: The file of the agent; the one that comes with the package if left out.
        any_arm: Whether it may control an arm that it was not trained for.
        hash: The first twelve digits of the agent's hash; another agent is refused. Results contain the actual ones.
        given: An agent in memory, in place of a file.

    Raises:
        ResultsError: The file cannot be read.
        InvalidInputError: It was trained for another arm or task, or its hash is another one.
    """

    policy: str = dataclasses.field(default="rhc", init=False)
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict, init=False)
    history: int = dataclasses.field(default=64, init=False)
    blend: float = dataclasses.field(default=0.01, init=False)
    path: str = ""
    any_arm: bool = False
    hash: str | None = None

    #: The description and the network in the file.
    processing: Recurrent = dataclasses.field(init=False, repr=False)
    network: GatedNetwork = dataclasses.field(init=False, repr=False)
    given: dataclasses.InitVar[AgentFile | None] = dataclasses.field(default=None, kw_only=True)

    name: ClassVar[str] = "recurrent"
    from_file: ClassVar[bool] = True
    positional: ClassVar[str] = "path"
    decisive: ClassVar[tuple[str, ...]] = ("path", "any_arm")
    #: As :class:`Calibrated`.
    evaluated: ClassVar[int] = 5

    def __post_init__(self, given: AgentFile | None) -> None:
        flag("any_arm", self.any_arm)
        file = given or agent_at(self.path or FOLDER / f"{SHIPPED}.safetensors", self.hash, (Recurrent,))
        check_scenario(file, self.problem, any_arm=self.any_arm)
        processing, network = file.processing, file.network
        assert isinstance(processing, Recurrent)
        assert isinstance(network, GatedNetwork)
        if network.sizes != Recurrent.sizes(network.sizes[1:-1]) or self.problem.task.kind != task_kernels.POSE:
            raise InvalidInputError(
                f"Agent {file.source}: expected a network of the sizes {Recurrent.sizes(network.sizes[1:-1])} and the "
                f"task pose, got {network.sizes} and {self.problem.task.name}."
            )
        if any(kind.from_file for kind in policies_in(processing.base_policy)):
            raise InvalidInputError(f"base_policy: expected a policy that is no agent, got {processing.base_policy}.")
        policy, options = parse_policy(processing.base_policy)
        fields = {"path": os.fspath(self.path), "hash": file.digits, "policy": policy, "options": options}
        for field, value in {**fields, "processing": processing, "network": network}.items():
            object.__setattr__(self, field, value)
        super().__post_init__()

    def own_memory(self, rows: int) -> RecurrentMemory:
        """See :meth:`Wrapper.own_memory`."""
        prior = self.processing.prior(self.problem.model.joints)
        covariance = np.repeat(np.diag(prior**2)[None], rows, axis=0)
        hidden = np.zeros((rows, self.network.units), np.float32)
        since = np.zeros(rows, np.int64)
        return RecurrentMemory(*self.sensors(rows), np.zeros((rows, len(prior))), covariance, hidden, since)

    def learn(
        self, batch: Batch, measured: Measurement, own: RecurrentMemory, out: FloatArray, old: FloatArray
    ) -> RecurrentMemory:
        """See :meth:`Corrected.learn`."""
        kept = own._replace(**{name: getattr(own, name).copy() for name in own._fields[3:]})
        filter_rows(
            self.problem.model.chain,
            self.network.constants,
            (self.processing.gap, self.processing.start**2),
            (batch.q, batch.pose, measured.q, measured.new),
            (measured.first, np.ascontiguousarray(batch.nominal[:, 0])),
            kept,
            out,
            old,
        )
        return kept
