"""Imitation: an agent learns what another policy does where the agent itself gets to (DAgger, Ross et al. 2011)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from gymnasium.utils import seeding
from torch import Tensor

from baselines import registry
from baselines.agents.features import project_rows, speed_rows
from baselines.policy import Batch, Problem
from baselines.spec import parse_policy
from baselines.training.config.direct import Imitate
from baselines.training.environment.view import View
from baselines.training.randomness import episode_seed, sequence
from baselines.training.trainer import Metrics
from baselines.training.trainers.direct import DirectTrainer
from baselines.training.trainers.models import answers
from ikgym.scenarios import Scenario
from ikgym.scenarios.scenario import furthest
from ikgym.simulator import Simulator, offsets
from ikgym.validation import FloatArray


class Examples(NamedTuple):
    """What is learned from, as float32.

    Attributes:
        features: Shape (N, f).
        answer: What the expert would have the agent answer. Shape (N, n).
    """

    features: Tensor
    answer: Tensor


class ImitateTrainer(DirectTrainer):
    """See :class:`Imitate`."""

    _config: Imitate

    def __init__(self, config: Imitate, scenario: Scenario, seed: int) -> None:
        super().__init__(config, scenario, seed)
        name, parameters = parse_policy(config.expert)
        self._expert = registry.make(name, scenario, **parameters)
        self._problem = Problem.of(scenario)
        view = View(config.processing, scenario)
        self._ahead = max(furthest(view.preview), furthest(self._expert.preview))
        self._examples: Examples | None = None

    def segment(self, number: int) -> Metrics:
        """See :meth:`baselines.training.trainer.Trainer.segment`."""
        self._set_learning_rate(number)
        generator = np.random.default_rng(sequence(self._seed, number))
        fresh, cost = self._play(number, generator)
        old = self._examples
        memory = self._config.memory
        joined = fresh if old is None else Examples(*[torch.cat(pair) for pair in zip(old, fresh, strict=True)])
        self._examples = Examples(*[part[-memory:].clone() for part in joined])
        losses = [self._learn() for _ in range(self._config.gradient_steps)]
        self._finished()
        return {"train/loss": float(np.mean(losses)), "train/cost": cost}

    def state(self) -> dict[str, Any]:
        """See :meth:`baselines.training.trainer.Trainer.state`."""
        return {**super().state(), "examples": None if self._examples is None else list(self._examples)}

    def restore(self, state: dict[str, Any]) -> None:
        """See :meth:`baselines.training.trainer.Trainer.restore`."""
        super().restore(state)
        self._examples = None if state["examples"] is None else Examples(*state["examples"])

    def _play(self, number: int, generator: np.random.Generator) -> tuple[Examples, float]:
        """Plays episodes, the expert looking on.

        Returns:
            Examples, and the geometric mean of the costs.
        """
        config, scenario = self._config, self._scenario
        rows, processing = config.envs, config.processing
        simulator = Simulator(scenario, rows, self._ahead)
        first = episode_seed(self._seed, number, rows)
        simulator.reset(np.ones(rows, dtype=np.bool_), [seeding.np_random(first + i)[0] for i in range(rows)])
        view, at = View(processing, scenario), np.array(processing.offsets) - 1
        led = np.ones(rows, dtype=np.bool_) if number == 0 else generator.random(rows) < config.led
        disturbance = _Disturbance(config.noise * generator.random(rows), generator, scenario.joints)
        out, starting, state = simulator.observe(), np.ones(rows, dtype=np.bool_), None
        costs = np.zeros(rows)
        parts: list[tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]] = []
        for step in range(scenario.steps):
            seen = {name: getattr(out, name) for name in Batch._fields}
            nominal = np.ascontiguousarray(out.nominal[:, at])
            features = view.see(seen, starting)
            right, state = self._expert.predict(seen | {"nominal": self._shown(out.nominal)}, state)
            if step % config.every == 0:
                parts.append((features.copy(), self._answer_of(right, out.q, nominal, view.base)))
            moved = right + disturbance.next(self._through, out.q, right)
            mine = view.act(answers(self.model, features))
            follows = led | (out.position_error > config.rescue)
            out = simulator.step(np.where(follows[:, None], moved, mine))
            starting = np.zeros(rows, dtype=np.bool_)
            costs += out.tracking_cost + out.velocity_cost
        self.model.num_timesteps += rows * scenario.steps
        examples = Examples(*[torch.from_numpy(np.concatenate(part)) for part in zip(*parts, strict=True)])
        return examples, float(np.exp(np.mean(np.log(np.maximum(costs, 1e-300)))))

    def _shown(self, nominal: FloatArray) -> FloatArray:
        """What the expert sees of the nominal coordinates ahead."""
        return np.ascontiguousarray(nominal[:, np.array(offsets(self._expert.preview)) - 1])

    def _answer_of(
        self, right: npt.NDArray[np.float32], q: FloatArray, nominal: FloatArray, base: FloatArray | None
    ) -> npt.NDArray[np.float32]:
        """What would have to be answered for the expert's actions, or for what the null space leaves of them."""
        processing, problem = self._config.processing, self._problem
        scratch = np.empty((*nominal.shape[:2], problem.task.error_size))
        speed = speed_rows(problem.task.kind, problem.dt, np.array(processing.offsets), nominal, scratch)
        missing = (right if base is None else right - base) * problem.velocity_limit
        answer: npt.NDArray[np.float64] = self._through(q, missing) / (processing.action_scale * speed[:, None])
        return answer.clip(-1.0, 1.0).astype(np.float32)

    def _through(self, q: FloatArray, velocity: FloatArray) -> FloatArray:
        """Joint velocities as the agent's answers can make them."""
        out = velocity.astype(np.float64)
        damping = self._config.null_space
        if damping is not None:
            problem = self._problem
            project_rows(problem.model.chain, problem.task.kind, damping, problem.task.error_size, q, out)
        return out

    def _learn(self) -> float:
        """One gradient step on ln(1 + |error|² / tolerance²), which wants what can be hit to be hit precisely.

        What cannot be hit, for experts are of two minds at times, hardly counts.
        """
        assert self._examples is not None
        chosen = torch.randint(len(self._examples.features), (self._config.batch_size,))
        error = self._answers(self._examples.features[chosen]) - self._examples.answer[chosen]
        loss = (error.square().sum(1) / self._config.tolerance**2).log1p().mean()
        self._descend(loss)
        return loss.item()


class _Disturbance:
    """Noise that drifts, of another size and pace in each row."""

    def __init__(self, size: FloatArray, generator: np.random.Generator, joints: int) -> None:
        self._size, self._generator = size, generator
        self._kept = np.where(np.arange(len(size)) % 2, 0.98, 0.997)[:, None]
        self._value = np.zeros((len(size), joints))

    def next(self, through: Any, q: FloatArray, action: npt.NDArray[Any]) -> FloatArray:
        """What is added to actions. Shapes (N, n)."""
        fresh = self._generator.normal(size=self._value.shape)
        self._value = self._kept * self._value + np.sqrt(1.0 - self._kept**2) * fresh
        out: FloatArray = self._size[:, None] * np.abs(action).max(1, keepdims=True) * through(q, self._value)
        return out
