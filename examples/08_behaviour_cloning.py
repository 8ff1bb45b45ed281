"""Behaviour cloning from a data set of Minari, in PyTorch: needs ``pip install "ikgym[data,train]"``."""

import sys
import tempfile
from pathlib import Path

import minari
import numpy as np
import torch
from torch import nn

from baselines import evaluate
from baselines.datasets.dataset import planned, write

SCENARIO, EXPERT = "varga7-random", "dls:damping=1e-2"


def features(observation):
    """The posture, and the way from the pose to its reference in millimetres and milliradians. Shape (…, 26)."""
    q, pose, ahead = observation["q"], observation["pose"], observation["nominal"][..., 0, :]
    return np.concatenate([np.sin(q), np.cos(q), pose, 1e3 * (ahead - pose)], axis=-1, dtype=np.float32)


class Clone:
    """A network with the `predict` of Stable-Baselines3."""

    preview = 1  # steps ahead that it is shown

    def __init__(self, seen, done):
        self.mean, self.spread, self.scale = seen.mean(0), seen.std(0) + 1e-6, done.std()
        layers = [nn.Linear(seen.shape[1], 256), nn.SiLU(), nn.Linear(256, 256), nn.SiLU(), nn.Linear(256, 7)]
        self.network = nn.Sequential(*layers)

    def __call__(self, seen):
        """Actions, before they are cut to their box."""
        return self.scale * self.network((seen - self.mean) / self.spread)

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        """The action for one arm; the memory is none."""
        with torch.no_grad():
            return self(torch.from_numpy(features(observation))).clamp(-1.0, 1.0).numpy(), None


def recorded(episodes):
    """What the expert saw in its episodes on training seeds, and what it did."""
    with tempfile.TemporaryDirectory() as folder:
        write(planned(SCENARIO, EXPERT, episodes=episodes), Path(folder) / "expert-v0")
        data = list(minari.MinariDataset(Path(folder) / "expert-v0" / "data"))
    seen = np.concatenate([features(episode.observations)[:-1] for episode in data])
    return torch.from_numpy(seen), torch.from_numpy(np.concatenate([episode.actions for episode in data]))


def main(episodes=32, epochs=5, validated=4):
    torch.manual_seed(0)
    torch.set_num_threads(1)  # the layers are too small to share out
    seen, done = recorded(episodes)
    clone = Clone(seen, done)
    optimizer = torch.optim.Adam(clone.network.parameters(), lr=1e-3)
    for epoch in range(epochs):
        losses = []
        for rows in torch.randperm(len(seen)).split(1024):
            loss = nn.functional.huber_loss(clone(seen[rows]) / clone.scale, done[rows] / clone.scale)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            losses.append(loss.item())
        print(f"epoch {epoch + 1}: loss {np.mean(losses):.4f}")
    for row in evaluate.evaluate(SCENARIO, [EXPERT, clone], episodes=validated, split="validation"):
        print(f"{row.policy}, seed {row.seed}: cost {row.total_cost:.4g}, error up to {row.position_error_max:.3f} m")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
