"""PPO in one file on the native vector environment, in the manner of CleanRL: needs ``pip install "ikgym[train]"``.

The task is simplified so that plain reinforcement learning improves within a minute: episodes of a tenth of a second,
features in which errors are about 1, and the logarithm of the cost as reward. For agents that keep up with solvers see
docs/agents.md.
"""

import sys

import gymnasium as gym
import numpy as np
import torch
from torch import nn
from torch.distributions import Normal

import ikgym  # registers the environment

ENVS, STEPS, EPOCHS, MINIBATCHES = 64, 100, 4, 8
GAMMA, LAMBDA, CLIP, RATE, LARGEST_GRADIENT = 0.9, 0.95, 0.2, 1e-3, 0.5
SCENARIO, PREVIEW = ikgym.scenarios.get("varga7-random").replace(steps=STEPS), 2


def features(observation: dict) -> torch.Tensor:
    """Features of N arms: posture, velocity, and the differences to the nominal coordinates ahead."""
    q, missing = observation["q"], observation["nominal"] - observation["pose"][:, None]
    parts = [np.sin(q), np.cos(q), 0.1 * observation["qdot"], 100.0 * missing.reshape(len(q), -1)]
    return torch.as_tensor(np.hstack(parts).clip(-5.0, 5.0), dtype=torch.float32)


def network(inputs: int, outputs: int, scale: float) -> nn.Sequential:
    """Two hidden layers, and a last one whose weights are scaled."""
    layers = nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs))
    with torch.no_grad():
        layers[-1].weight.mul_(scale)
    return layers


class Agent(nn.Module):
    """A Gaussian policy and a value, with separate networks."""

    def __init__(self, inputs: int, joints: int) -> None:
        super().__init__()
        self.critic, self.actor = network(inputs, 1, 1.0), network(inputs, joints, 0.01)
        self.log_std = nn.Parameter(torch.full((joints,), -3.0))

    def policy(self, seen: torch.Tensor) -> Normal:
        """The distribution of actions."""
        return Normal(self.actor(seen), self.log_std.exp())

    def value(self, seen: torch.Tensor) -> torch.Tensor:
        """The expected discounted return."""
        return self.critic(seen).squeeze(-1)


def rollout(envs: gym.vector.VectorEnv, agent: Agent, seen: torch.Tensor) -> tuple[dict, torch.Tensor, list[float]]:
    """STEPS steps of all arms: features, actions and rewards with advantages, and the costs of ended episodes."""
    kept: dict = {name: [] for name in ("seen", "action", "log_prob", "value", "reward", "ended")}
    costs = []
    for _ in range(STEPS):
        with torch.no_grad():
            normal, value = agent.policy(seen), agent.value(seen)
            action = normal.sample()
        observation, reward, _, ended, _ = envs.step(action.clamp(-1.0, 1.0).numpy())
        envs.costs += -reward
        costs += envs.costs[ended].tolist()
        envs.costs[ended] = 0.0
        step = (seen, action, normal.log_prob(action).sum(-1), value, -np.log10(1.0 - reward), ended)
        for name, part in zip(kept, step, strict=True):
            kept[name].append(torch.as_tensor(part, dtype=torch.float32))
        seen = features(observation)
    batch = {name: torch.stack(parts) for name, parts in kept.items()}
    with torch.no_grad():
        value_after = agent.value(seen)
    batch["advantage"] = advantages(batch, value_after)
    batch["return"] = batch["advantage"] + batch["value"]
    return batch, seen, costs


def advantages(batch: dict, value_after: torch.Tensor) -> torch.Tensor:
    """Generalised advantage estimation; the value after the end of an episode counts as 0."""
    out, last = torch.zeros_like(batch["reward"]), torch.zeros_like(value_after)
    for t in reversed(range(STEPS)):
        going_on = 1.0 - batch["ended"][t]
        delta = batch["reward"][t] + GAMMA * value_after * going_on - batch["value"][t]
        last = delta + GAMMA * LAMBDA * going_on * last
        out[t], value_after = last, batch["value"][t]
    return out


def update(agent: Agent, optimiser: torch.optim.Optimizer, batch: dict) -> None:
    """Some epochs of gradient steps on minibatches of the clipped objective."""
    flat = {name: part.flatten(0, 1) for name, part in batch.items()}
    for _ in range(EPOCHS):
        for rows in torch.randperm(ENVS * STEPS).chunk(MINIBATCHES):
            part = {name: values[rows] for name, values in flat.items()}
            normal, value = agent.policy(part["seen"]), agent.value(part["seen"])
            ratio = (normal.log_prob(part["action"]).sum(-1) - part["log_prob"]).exp()
            gain = (part["advantage"] - part["advantage"].mean()) / (part["advantage"].std() + 1e-8)
            loss = -torch.min(ratio * gain, ratio.clamp(1.0 - CLIP, 1.0 + CLIP) * gain).mean()
            loss = loss + 0.5 * (value - part["return"]).square().mean()
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), LARGEST_GRADIENT)
            optimiser.step()


def main(updates: int = 30, seed: int = 0) -> list[float]:
    """Trains an agent, and returns the mean reward of each update."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)  # networks are small
    # Rows whose episode has ended are reset in the same step: every transition is one of an episode.
    envs = gym.make_vec("RedundantIK-v0", num_envs=ENVS, scenario=SCENARIO, preview=PREVIEW, autoreset_mode="SameStep")
    envs.costs = np.zeros(ENVS)
    seen = features(envs.reset(seed=seed)[0])  # seeds of the split `train`
    agent = Agent(seen.shape[1], envs.single_action_space.shape[0])
    optimiser = torch.optim.Adam(agent.parameters(), lr=RATE, eps=1e-5)
    rewards = []
    for number in range(1, updates + 1):
        batch, seen, costs = rollout(envs, agent, seen)
        update(agent, optimiser, batch)
        rewards.append(float(batch["reward"].mean()))
        ended = f", median cost of {len(costs)} episodes {np.median(costs):.3g}" if costs else ""
        print(f"update {number}: {number * ENVS * STEPS} steps, mean reward {rewards[-1]:.3f}{ended}")
    return rewards


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
