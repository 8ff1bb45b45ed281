"""SAC of Stable-Baselines3 on ``ikgym/Track-v0``: needs ``pip install "ikgym[train]"``."""

import sys

from stable_baselines3 import SAC

import ikgym.sb3
from baselines.training.exporting import export

ID = "ikgym/Track-v0"


def main(file="track-sac.safetensors", steps=50_000):
    """Trains an agent, writes it for ``ikgym evaluate --policies agent:FILE``, and returns its validation score."""
    envs = ikgym.sb3.make_vec(ID, 32)
    settings = {"gamma": 0.9, "ent_coef": "auto_0.01", "learning_rate": 1e-3, "learning_starts": min(2000, steps // 2)}
    model = SAC("MlpPolicy", envs, **settings, seed=0, device="cpu").learn(steps)
    export(model, envs, file)
    costs = ikgym.rl.costs(model, ID, episodes=32)
    score = ikgym.rl.score({ID: [costs]})[ID].mean
    print(f"score {score:.2f} after {steps} steps; an arm at rest scores 0, tuned dls 1")
    return score


if __name__ == "__main__":
    main(*sys.argv[1:2], *map(int, sys.argv[2:]))
