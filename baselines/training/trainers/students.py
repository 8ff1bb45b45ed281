"""Whose network learns what an expert does: what an example of it is, and what the network says of one."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.features import project_rows, speed_rows
from baselines.agents.protocols import Transform
from baselines.policy import Batch, Problem
from baselines.training.config.actor_only import Imitate
from baselines.training.environment.vec_env import ProcessedVecEnv
from baselines.training.gradients.law import Law
from baselines.training.networks import ActorModel
from baselines.training.trainers.initial_weights import begin_actor_from, begin_from
from baselines.training.trainers.models import mean_network, new_model, squash_of
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

Singles = npt.NDArray[np.float32]


class Student(Protocol):
    """A model that learns from examples.

    Attributes:
        model: What is evaluated and kept.
        actor: Its network.
    """

    model: Any
    actor: nn.Sequential

    @property
    def processing(self) -> Transform:
        """What it sees, and what its outputs mean."""

    def example(self, batch: Batch, right: Singles, base: FloatArray | None) -> tuple[Singles, FloatArray]:
        """What an expert's actions are for the student.

        Args:
            batch: What arms show, with the nominal coordinates at the student's offsets.
            right: The expert's actions. Shape (N, n).
            base: Those of the base policy, where there is one. Shape (N, n).

        Returns:
            What :meth:`said` should be, of shape (N, n), and what it depends on beside the features, of shape (N, k).
        """

    def said(self, features: Tensor, given: Tensor) -> Tensor:
        """What the network says, with gradients. Shapes (N, f), (N, k) and (N, n)."""

    def projected(self, q: FloatArray, velocity: FloatArray) -> FloatArray:
        """Joint velocities as network outputs can make them. Shapes (N, n)."""

    def finished(self) -> None:
        """Lets all that copies the actor follow it."""


class VelocityStudent:
    """A model of Stable-Baselines3 whose network gives joint velocities, or corrections of those of a policy."""

    def __init__(self, config: Imitate, scenario: Scenario) -> None:
        self._config, self._problem = config, Problem.of(scenario)
        self.processing = config.velocities
        self.model: Any = new_model(
            config.algorithm, ProcessedVecEnv(1, scenario, self.processing), config.hidden, config.activation
        )
        if config.init is not None:
            begin_from(self.model, config)
        self.actor = mean_network(self.model)
        self._squash = squash_of(config.algorithm)

    def example(self, batch: Batch, right: Singles, base: FloatArray | None) -> tuple[Singles, FloatArray]:
        """Network outputs for the expert's actions, or for their projection into the null space."""
        processing, problem, nominal = self.processing, self._problem, batch.nominal
        scratch = np.empty((*nominal.shape[:2], problem.task.error_size))
        speed = speed_rows(problem.task.kind, problem.dt, np.array(processing.offsets), nominal, scratch)
        missing = (right if base is None else right - base) * problem.velocity_limit
        target = self.projected(batch.q, missing) / (processing.action_scale * speed[:, None])
        return target.clip(-1.0, 1.0).astype(np.float32), np.empty((len(target), 0))

    def said(self, features: Tensor, given: Tensor) -> Tensor:
        """Network outputs."""
        del given
        mean: Tensor = self.actor(features)
        return mean.tanh() if self._squash == "tanh" else mean

    def projected(self, q: FloatArray, velocity: FloatArray) -> FloatArray:
        """See :meth:`Student.projected`."""
        out = velocity.astype(np.float64)
        damping, problem = self._config.null_space, self._problem
        if damping is not None:
            project_rows(problem.model.chain, problem.task.kind, damping, problem.task.error_size, q, out)
        return out

    def finished(self) -> None:
        """See :meth:`Student.finished`."""
        target = getattr(self.model.policy, "actor_target", None)
        if target is not None:
            target.load_state_dict(self.model.policy.actor.state_dict())


class BilinearStudent:
    """An actor whose network gives G and h, as those of `apg`.

    Many of them make the same joint velocities; what is learned is the velocities, through the law of the agent.
    """

    def __init__(self, config: Imitate, scenario: Scenario) -> None:
        self._law, self._problem = Law(scenario, config.bilinear), Problem.of(scenario)
        self.processing: Bilinear = config.bilinear
        self.model = ActorModel.new((self._law.inputs, *config.hidden, self._law.outputs), config.activation)
        if config.init is not None:
            begin_actor_from(self.model.policy, config)
        self.actor = self.model.policy

    def example(self, batch: Batch, right: Singles, base: FloatArray | None) -> tuple[Singles, FloatArray]:
        """Joint velocities in units of the speed of what is ahead; q and v / s."""
        del base
        due, speed = self.processing.due(self._problem, batch)
        target = right * self._problem.velocity_limit / speed[:, None]
        return target.astype(np.float32), np.concatenate([batch.q, due], axis=1)

    def said(self, features: Tensor, given: Tensor) -> Tensor:
        """q̇ / s = G v / s + h."""
        n = self._problem.model.joints
        q, due = given[:, :n].contiguous(), given[:, n:]
        held = self._law.held(q, features.double(), self.actor(features).double()).view(len(q), n, -1)
        return torch.einsum("bja,ba->bj", held[..., :-1], due) + held[..., -1]

    def projected(self, q: FloatArray, velocity: FloatArray) -> FloatArray:
        """Any, as they are."""
        del q
        return velocity.astype(np.float64)

    def finished(self) -> None:
        """Nothing copies the actor."""


def student(config: Imitate, scenario: Scenario) -> Student:
    """The untrained one that a configuration asks for, or that of its `init`."""
    return (VelocityStudent if config.output == "velocities" else BilinearStudent)(config, scenario)
