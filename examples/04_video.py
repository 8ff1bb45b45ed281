"""A slow-motion video of a solver, every tenth step a picture: needs ``pip install "ikgym[video]"``."""

import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
from moviepy import ImageSequenceClip

import baselines
import ikgym  # noqa: F401  # registers the environment


def main(path: Path, steps: int = 3000) -> None:
    """Writes a video of an episode."""
    policy = baselines.make("dls", "varga7-fast")
    env = gym.make("RedundantIK-v0", scenario="varga7-fast", preview=policy.preview, render_mode="rgb_array")
    observation, _ = env.reset()
    pictures, state = [np.asarray(env.render())], None
    for k in range(steps):
        action, state = policy.predict(observation, state)
        observation, *_ = env.step(action)
        if k % 10 == 9:
            pictures.append(np.asarray(env.render()))
    ImageSequenceClip(pictures, fps=50).write_videofile(str(path), logger=None)
    print(f"wrote {path.name}: {len(pictures)} pictures")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "varga7-fast.mp4"))
