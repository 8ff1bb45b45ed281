"""From observations to features, and from network outputs to actions: the one path of training and evaluation."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from baselines.agents.base_policy import SharedPreview, make_base_policy
from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.bounds import Bounds
from baselines.agents.features import Features
from baselines.agents.network import Network
from baselines.agents.protocols import Actor, Transform
from baselines.agents.relative.processing import Relative
from baselines.policy import Batch, Memory, Problem, SolverPolicy
from baselines.wrapper import InnerStep
from ikgym.validation import FloatArray


class Seen(NamedTuple):
    """What an agent sees at a step, and what its network output adds to.

    Attributes:
        features: Shape (B, f).
        batch: The observations, `nominal` at the offsets of the agent.
        base: Actions of the base policy, in float64; None where there is none. Shape (B, n).
        step: What else the base policy did; None where there is none.
    """

    features: Features
    batch: Batch
    base: FloatArray | None
    step: InnerStep | None


@dataclasses.dataclass(frozen=True, eq=False)
class AgentView:
    """An agent's processing for one scenario, with the base policy in between.

    Args:
        processing: Of the agent.
        problem: What the agent and the base policy are told of the scenario.
        base: The base policy; None for an agent that stands alone.
        preview: What both are shown.
        bounds: Of the velocities of a bilinear agent; None where there are none.
    """

    processing: Transform
    problem: Problem
    base: SolverPolicy | None
    preview: SharedPreview
    bounds: Bounds | None

    @classmethod
    def of(cls, processing: Transform, problem: Problem) -> Self:
        """That of an agent.

        Raises:
            UnknownNameError: There is no such base policy, or parameter of it.
            InvalidInputError: The base policy is refused, see :func:`make_base_policy`.
        """
        base = make_base_policy(processing, problem)
        bounds = Bounds.of(problem) if isinstance(processing, (Bilinear, Relative)) else None
        return cls(processing, problem, base, SharedPreview.of(processing, base), bounds)

    def see(self, batch: Batch, memory: Memory) -> Seen:
        """What the agent sees; the base policy acts once.

        Args:
            batch: The observations, as :attr:`preview` asks for them; C-contiguous.
            memory: Of the base policy.
        """
        step: InnerStep | None = None
        base: FloatArray | None = None
        if self.base is not None:
            shown = batch._replace(nominal=self.preview.for_base(batch.nominal))
            step = InnerStep.of(self.base, shown, memory)
            base = step.action.astype(np.float64)
        own = batch._replace(nominal=self.preview.for_agent(batch.nominal))
        return Seen(self.processing.features(self.problem, own, base), own, base, step)

    def act(self, batch: Batch, memory: Memory, network: Actor) -> tuple[FloatArray, InnerStep | None]:
        """What an agent does.

        Args:
            batch: As in :meth:`see`.
            memory: Of the base policy.
            network: The agent's.

        Returns:
            Fractions of the velocity limit, and what else the base policy did.
        """
        if isinstance(self.processing, (Bilinear, Relative)) and isinstance(network, Network):
            own = batch._replace(nominal=self.preview.for_agent(batch.nominal))
            return self._bounded(own, self.processing.law(self.problem, own, network)), None
        seen = self.see(batch, memory)
        return self.action(seen, network.forward(seen.features)), seen.step

    def action(self, seen: Seen, output: npt.NDArray[Any]) -> FloatArray:
        """What network outputs mean, as fractions of the velocity limit.

        Args:
            seen: What the outputs are for.
            output: Shape (B, n).
        """
        return self._bounded(seen.batch, self.processing.action(self.problem, seen.batch, output, seen.base))

    def _bounded(self, batch: Batch, action: FloatArray) -> FloatArray:
        return action if self.bounds is None else self.bounds.keep(batch, action)
