"""How noisy the gradient is that an actor learns from: ``python -m benchmarks.gradient_noise ppo=quick apg=quick``.

Takes the gradient of an untrained actor from many batches, without changing the actor, and prints the gradient noise
scale of McCandlish et al. 2018, tr Σ / |G|², where G is the mean of the gradients and Σ the covariance of one step of
the environment: as many steps as a batch has to have for its noise to be as large as what it says. The critic of PPO is
trained first. Both are estimated without bias, |G|² from the products of different batches; where their mean is not
above twice its standard error the batches are too few to tell, and a lower bound is given.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
import tyro
from torch import Tensor, nn
from tqdm import tqdm

from baselines.evaluation.pages.markdown import table
from baselines.evaluation.report import number
from baselines.spec import parse_parameters
from baselines.training import presets
from baselines.training.config.actor_only import APG
from baselines.training.config.base import Config
from baselines.training.config.ppo import PPO
from baselines.training.randomness import deterministic_torch, reseed, sequence
from baselines.training.trainers.apg import APGTrainer
from baselines.training.trainers.models import mean_network
from baselines.training.trainers.ppo import PPOTrainer
from baselines.training.trainers.rollout_end import GroupBaseline
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray, known_names

HEAD = ("gradient", "steps of a batch", "noise of a batch ÷ gradient", "noise scale in steps", "in core-min")

#: By all weights of an actor. Shape (weights,).
Gradient = npt.NDArray[np.float64]


class Batches(NamedTuple):
    """Independent batches of an untrained actor: each begins episodes of its own.

    Attributes:
        take: Gives the gradient of the next one.
        steps: Of the environment, in a batch.
    """

    take: Callable[[], Gradient]
    steps: int


@dataclasses.dataclass(frozen=True)
class Command:
    """Measures the noise of policy gradients."""

    gradients: Annotated[tuple[str, ...], tyro.conf.Positional] = ("ppo=quick", "apg=quick")
    """METHOD=PRESET, of ppo and apg; METHOD=PRESET,OPTION=VALUE,… with other options than the preset's."""
    batches: int = 64
    """Gradients that are taken, at least 3."""
    critic_segments: int = 3
    """Segments in which the critic of PPO is trained first."""
    n_envs: int | None = None
    """Arms that are stepped together, if not those of the preset."""
    seed: int = 0
    """Of the actor and of the paths."""


class Noise(NamedTuple):
    """How far gradients of batches differ.

    Attributes:
        scale: tr Σ / |G|², with Σ that of whole batches; infinite where |G|² is not told from 0.
        least: What it is at least: |G|² is at most two standard errors above its estimate.
    """

    scale: float
    least: float


def noise_of(gradients: FloatArray) -> Noise:
    """The noise of some gradients.

    Args:
        gradients: Of independent batches. Shape (B, weights), B at least 3.

    Raises:
        InvalidInputError: There are less than three.
    """
    count = _enough(len(gradients))
    products = gradients @ gradients.T
    size = float(np.trace(products)) / count
    # |G|² without each batch in turn, whose spread gives the standard error (jackknife).
    total, own = float(products.sum() - np.trace(products)), np.diag(products)
    without = (total - 2.0 * (products.sum(axis=1) - own)) / ((count - 1) * (count - 2))
    signal = total / (count * (count - 1))
    error = math.sqrt((count - 1) / count * float(np.sum((without - without.mean()) ** 2)))
    most = signal + 2.0 * error
    if signal <= 2.0 * error:
        return Noise(math.inf, max(size - most, 0.0) / most if most > 0.0 else math.inf)
    return Noise((size - signal) / signal, max(size - most, 0.0) / most)


def of_ppo(config: PPO, seed: int) -> Batches:
    """Gradients of the objective of PPO before its first step, where nothing is clipped.

    Args:
        config: In the first `critic_warmup` segments the critic is trained.
        seed: Of the actor and of the paths.
    """
    reseed(seed, None)
    trainer = PPOTrainer(config, config.make_scenario(), seed)
    for segment in tqdm(range(config.critic_warmup), desc="critic", unit="segment"):
        reseed(seed, segment)
        trainer.segment(segment)
    model, hold = trainer.model, config.hold if config.output == "inverse" else 1
    weights = list(mean_network(model).parameters())
    baseline = GroupBaseline() if config.group_size > 1 else None
    _, callback = model._setup_learn(model.num_timesteps, baseline)

    def take() -> Gradient:
        model._last_obs = model.env.reset()
        model._last_episode_starts = np.ones(config.n_envs, dtype=np.bool_)
        model.collect_rollouts(model.env, callback, model.rollout_buffer, model.n_steps)
        (data,) = model.rollout_buffer.get()
        _, log_probability, _ = model.policy.evaluate_actions(data.observations, data.actions)
        advantages = data.advantages - data.advantages.mean()
        return _gradient(-(advantages * log_probability).mean(), weights)

    return Batches(take, model.n_steps * config.n_envs * hold)


def of_apg(config: APG, seed: int) -> Batches:
    """Gradients of windows that are as long as the last ones.

    Args:
        config: Whose windows they are.
        seed: Of the actor and of the paths.
    """
    reseed(seed, None)
    trainer, steps = APGTrainer(config, config.make_scenario(), seed), config.window[-1]
    generator = np.random.default_rng(sequence(seed, 0))

    def take() -> Gradient:
        trainer.spread(generator)
        loss, _ = trainer.window(steps, generator)
        return _gradient(loss, list(trainer.actor.parameters()))

    return Batches(take, steps * config.n_envs)


def lines(command: Command) -> list[str]:
    """The table.

    Raises:
        UnknownNameError: There is no such method, preset or option.
        InvalidInputError: There are less than three batches, or an option has another form or is refused.
    """
    _enough(command.batches)
    rows = []
    for given in command.gradients:
        batches = _batches(given, command)
        batches.take()  # compiles
        begun = time.process_time()
        taken = [batches.take() for _ in tqdm(range(command.batches), desc=given, unit="batch")]
        spent, noise = (time.process_time() - begun) / 60.0 / command.batches, noise_of(np.stack(taken))
        scale, above = (noise.scale, "") if math.isfinite(noise.scale) else (noise.least, "> ")
        numbers = math.sqrt(scale), scale * batches.steps, scale * spent
        rows.append((given, f"{batches.steps:,}", *(f"{above}{number(x)}" for x in numbers)))
    return table(HEAD, rows, text=[0])


def _enough(batches: int) -> int:
    """Insists on as many batches as a standard error needs."""
    if batches < 3:
        raise InvalidInputError(f"batches: expected at least 3, got {batches}.")
    return batches


def _batches(given: str, command: Command) -> Batches:
    chosen, _, options = given.partition(",")
    method, _, preset = chosen.partition("=")
    known_names("method", [method], METHODS)
    kind, take = METHODS[method]
    config: Any = presets.configure(kind, preset)[0]
    changes = parse_parameters(options, repr(given)) if options else {}
    if command.n_envs is not None:
        changes["n_envs"] = command.n_envs
    if kind is PPO:
        changes["critic_warmup"] = command.critic_segments
        if command.n_envs is not None:
            changes["batch_size"] = command.n_envs
    return take(kind.from_json({**config.to_json(), **changes}), command.seed)


def _gradient(loss: Tensor, weights: Sequence[nn.Parameter]) -> Gradient:
    parts = torch.autograd.grad(loss, list(weights))
    return np.concatenate([part.detach().numpy().ravel() for part in parts]).astype(np.float64)


METHODS: dict[str, tuple[type[Config], Callable[[Any, int], Batches]]] = {"ppo": (PPO, of_ppo), "apg": (APG, of_apg)}


def main(arguments: Sequence[str] | None = None) -> None:
    """Measures, and prints the table.

    Args:
        arguments: Of the command line; those of this process if left out.
    """
    command = tyro.cli(Command, prog="python -m benchmarks.gradient_noise", description=__doc__, args=arguments)
    with deterministic_torch():
        print("\n".join(lines(command)))


if __name__ == "__main__":
    main()
