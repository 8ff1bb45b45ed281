"""PPO of TorchRL on ``ikgym/Track-v0``, 64 arms in one kernel: needs ``pip install "ikgym[train]" torchrl``."""

import sys

import gymnasium as gym
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

ID, ENVS, STEPS, EPOCHS, BATCH = "ikgym/Track-v0", 64, 32, 5, 512


class Policy:
    """An actor with the `predict` that ``ikgym.rl.costs`` plays."""

    def __init__(self, actor):
        self.actor = actor

    def predict(self, observation, state=None, **_):
        """The mean action."""
        seen = TensorDict({"observation": torch.as_tensor(observation)}, batch_size=len(observation))
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
            return self.actor(seen)["action"].numpy(), state


def networks(inputs, joints):
    """A Gaussian policy and a value."""
    layers = {"in_features": inputs, "num_cells": [256, 256], "activation_class": nn.ReLU}
    mean = nn.Sequential(MLP(out_features=joints, **layers), AddStateIndependentNormalScale(joints, init_value=-1.5))
    with torch.no_grad():
        mean[0][-1].weight.mul_(0.01)
    numbers = TensorDictModule(mean, in_keys=["observation"], out_keys=["loc", "scale"])
    options = {"distribution_class": IndependentNormal, "return_log_prob": True}
    actor = ProbabilisticActor(numbers, in_keys=["loc", "scale"], **options)
    return actor, ValueOperator(MLP(out_features=1, **layers), in_keys=["observation"])


def main(updates=200, seed=0):
    """Trains an agent, and returns its validation score."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)  # networks are small
    envs = GymWrapper(gym.make_vec(ID, num_envs=ENVS, autoreset_mode="SameStep"))
    envs.set_seed(seed)
    actor, critic = networks(envs.observation_spec["observation"].shape[-1], envs.action_spec.shape[-1])
    advantage, frames = GAE(gamma=0.95, lmbda=0.95, value_network=critic), ENVS * STEPS
    loss = ClipPPOLoss(actor, critic, entropy_bonus=False, critic_coeff=0.5, normalize_advantage=True)
    optimiser = torch.optim.Adam(loss.parameters(), lr=1e-3, eps=1e-5)
    rate = torch.optim.lr_scheduler.LinearLR(optimiser, 1.0, 1e-3, updates)
    storage, sampler = LazyTensorStorage(frames), SamplerWithoutReplacement()
    buffer = TensorDictReplayBuffer(storage=storage, sampler=sampler, batch_size=BATCH)
    for batch in Collector(envs, actor, frames_per_batch=frames, total_frames=updates * frames):
        with torch.no_grad():
            advantage(batch)
        buffer.extend(batch.reshape(-1))
        for part in (part for _ in range(EPOCHS) for part in buffer):
            losses = loss(part)
            optimiser.zero_grad()
            (losses["loss_objective"] + losses["loss_critic"]).backward()
            nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
            optimiser.step()
        rate.step()
    score = ikgym.rl.score({ID: [ikgym.rl.costs(Policy(actor), ID, episodes=32)]})[ID].mean
    print(f"score {score:.2f} after {updates} updates")
    return score


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
