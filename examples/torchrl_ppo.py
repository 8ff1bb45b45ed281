"""PPO of TorchRL on ``ikgym/Track-v0``: needs ``pip install "ikgym[train]" torchrl``.

``GymEnv("ikgym/Track-v0")`` is one arm; here 64 are stepped by one kernel.
"""

import sys

import gymnasium as gym
import numpy as np
import torch
from tensordict import TensorDict
from tensordict.nn import AddStateIndependentNormalScale, TensorDictModule
from torch import nn
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, SamplerWithoutReplacement, TensorDictReplayBuffer
from torchrl.envs import ExplorationType, GymWrapper, set_exploration_type
from torchrl.modules import MLP, IndependentNormal, ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

import ikgym

ID, ENVS, STEPS, EPOCHS, BATCH, RATE = "ikgym/Track-v0", 64, 32, 5, 512, 1e-3


class Policy:
    """An actor in the form in which ``ikgym.rl.costs`` plays agents."""

    def __init__(self, actor: ProbabilisticActor) -> None:
        self.actor = actor

    def predict(self, observation: np.ndarray, state: object = None, **_: object) -> tuple[np.ndarray, object]:
        """The mean action."""
        seen = TensorDict({"observation": torch.as_tensor(observation)}, batch_size=len(observation))
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
            return self.actor(seen)["action"].numpy(), state


def networks(inputs: int, joints: int) -> tuple[ProbabilisticActor, ValueOperator]:
    """A Gaussian policy and a value."""
    layers = {"in_features": inputs, "num_cells": [256, 256], "activation_class": nn.ReLU}
    mean = nn.Sequential(MLP(out_features=joints, **layers), AddStateIndependentNormalScale(joints, init_value=-1.5))
    with torch.no_grad():
        mean[0][-1].weight.mul_(0.01)
    numbers = TensorDictModule(mean, in_keys=["observation"], out_keys=["loc", "scale"])
    actor = ProbabilisticActor(
        numbers, in_keys=["loc", "scale"], distribution_class=IndependentNormal, return_log_prob=True
    )
    return actor, ValueOperator(MLP(out_features=1, **layers), in_keys=["observation"])


def train(envs: GymWrapper, actor: ProbabilisticActor, critic: ValueOperator, updates: int) -> None:
    """Collects steps of all arms, and takes gradient steps on minibatches of them, in turn."""
    frames = ENVS * STEPS
    advantage = GAE(gamma=0.95, lmbda=0.95, value_network=critic)
    loss = ClipPPOLoss(actor, critic, entropy_bonus=False, critic_coeff=0.5, normalize_advantage=True)
    optimiser = torch.optim.Adam(loss.parameters(), lr=RATE, eps=1e-5)
    rate = torch.optim.lr_scheduler.LinearLR(optimiser, 1.0, 1e-3, updates)
    buffer = TensorDictReplayBuffer(
        storage=LazyTensorStorage(frames), sampler=SamplerWithoutReplacement(), batch_size=BATCH
    )
    for batch in Collector(envs, actor, frames_per_batch=frames, total_frames=updates * frames):
        with torch.no_grad():
            advantage(batch)
        buffer.extend(batch.reshape(-1))
        for _ in range(EPOCHS):
            for part in buffer:
                losses = loss(part)
                optimiser.zero_grad()
                (losses["loss_objective"] + losses["loss_critic"]).backward()
                nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
                optimiser.step()
        rate.step()


def main(updates: int = 200, seed: int = 0) -> float:
    """Trains an agent, and returns its score on validation episodes."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)  # networks are small
    envs = GymWrapper(gym.make_vec(ID, num_envs=ENVS, autoreset_mode="SameStep"))
    envs.set_seed(seed)
    actor, critic = networks(envs.observation_spec["observation"].shape[-1], envs.action_spec.shape[-1])
    train(envs, actor, critic, updates)
    costs = ikgym.rl.costs(Policy(actor), ID, episodes=32)
    score = ikgym.rl.score({ID: [costs]})[ID].mean
    print(f"score {score:.2f} after {updates} updates")
    return score


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
