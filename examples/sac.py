"""SAC of Stable-Baselines3 on ``ikgym/Track-v0``, saved, scored, filmed: needs ``pip install "ikgym[train,video]"``."""

import sys
from pathlib import Path

import gymnasium as gym
from gymnasium.wrappers import RecordVideo
from stable_baselines3 import SAC

import ikgym
import ikgym.sb3

ID = "ikgym/Track-v0"


def train(steps: int, file: Path) -> None:
    """Trains as ``baselines/training/settings/sac.yml`` says, with a constant learning rate, and saves the model."""
    envs = ikgym.sb3.make_vec(ID, 32)
    settings = {"gamma": 0.9, "ent_coef": "auto_0.01", "learning_rate": 1e-3, "learning_starts": min(2000, steps // 2)}
    model = SAC("MlpPolicy", envs, **settings, seed=0, device="cpu")
    model.learn(steps)
    model.save(file)


def film(model: SAC, folder: Path, steps: int) -> None:
    """Writes a video of an episode."""
    env = RecordVideo(gym.make(ID, render_mode="rgb_array"), str(folder), name_prefix="track", disable_logger=True)
    observation, _ = env.reset(seed=ikgym.scenarios.SPLITS["validation"].start)
    for _ in range(steps):
        action, _ = model.predict(observation, deterministic=True)
        observation, *_ = env.step(action)
    env.close()


def main(folder: Path, steps: int = 50_000, filmed: int = 200) -> float:
    """Trains an agent, and returns its score on validation episodes."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "track-sac.zip"
    train(steps, file)
    model = SAC.load(file, device="cpu")
    costs = ikgym.rl.costs(model, ID, episodes=32)
    score = ikgym.rl.score({ID: [costs]})[ID].mean
    film(model, folder / "videos", filmed)
    print(f"score {score:.2f} after {steps} steps: 0 is an arm that stands still, 1 is tuned dls")
    return score


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "track-sac"), *map(int, sys.argv[2:]))
