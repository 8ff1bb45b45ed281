"""Behaviour cloning from a data set of Minari, in PyTorch: needs ``pip install "ikgym[data,train]"``."""

import sys
import tempfile
from pathlib import Path

import minari
import numpy as np
import torch
from torch import nn

from baselines import datasets, evaluate

SCENARIO, EXPERT = "panda-random", "dls:damping=1e-2"


def features(observation):
    """Sine and cosine of the joints, and the distance to the reference ahead, in thousandths of each coordinate."""
    q, ahead = observation["q"], observation["nominal"][..., 0, :] - observation["pose"]
    return np.concatenate([np.sin(q), np.cos(q), 1e3 * ahead], axis=-1, dtype=np.float32)


class Clone:
    """The action is a gain times the distance ahead; the gain depends on the posture, as that of the expert does.

    It has the `predict` of Stable-Baselines3.
    """

    preview = 1  # steps ahead that it is shown

    def __init__(self, joints, coordinates):
        self.shape = joints, coordinates
        layers = [nn.Linear(2 * joints, 256), nn.SiLU(), nn.Linear(256, 256), nn.SiLU()]
        self.network = nn.Sequential(*layers, nn.Linear(256, joints * coordinates))

    def __call__(self, seen):
        """Actions, not yet clipped to their box."""
        posture, ahead = seen.split([2 * self.shape[0], self.shape[1]], dim=-1)
        return (self.network(posture).unflatten(-1, self.shape) @ ahead[..., None])[..., 0]

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        """The action for one arm; there is no memory."""
        with torch.no_grad():
            return self(torch.from_numpy(features(observation))).clamp(-1.0, 1.0).numpy(), None


def recorded(episodes):
    """Features and actions of the expert in episodes of training seeds."""
    with tempfile.TemporaryDirectory() as folder:
        datasets.write(SCENARIO, EXPERT, Path(folder) / "expert-v0", episodes=episodes)
        data = list(minari.MinariDataset(Path(folder) / "expert-v0" / "data"))
    seen = np.concatenate([features(episode.observations)[:-1] for episode in data])
    return torch.from_numpy(seen), torch.from_numpy(np.concatenate([episode.actions for episode in data]))


def main(episodes=32, epochs=5, validated=4):
    """Clones a policy, and compares the two on validation episodes."""
    torch.manual_seed(0)
    torch.set_num_threads(1)  # the layers are too small to share out
    seen, done = recorded(episodes)
    clone, spread = Clone(done.shape[1], seen.shape[1] - 2 * done.shape[1]), done.std()
    optimizer = torch.optim.Adam(clone.network.parameters(), lr=1e-3)
    for epoch in range(epochs):
        losses = []
        for rows in torch.randperm(len(seen)).split(512):
            loss = nn.functional.huber_loss(clone(seen[rows]) / spread, done[rows] / spread)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            losses.append(loss.item())
        print(f"epoch {epoch + 1}: loss {np.mean(losses):.4f}")
    for row in evaluate.evaluate(SCENARIO, [EXPERT, clone], episodes=validated, split="validation"):
        error = 1e3 * row.position_error_max
        print(f"{row.policy}, seed {row.seed}: cost {row.total_cost:.4g}, error up to {error:.2f} mm")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
