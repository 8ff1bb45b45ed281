"""The environment by itself: one arm, one episode, the reward of doing nothing."""

import gymnasium as gym
import numpy as np

import ikgym  # noqa: F401  # registers the environment


def main() -> None:
    """Plays one episode without moving the arm."""
    env = gym.make("RedundantIK-v0", scenario="varga7-fast", preview=2)
    observation, _ = env.reset(seed=0)
    print({key: value.shape for key, value in observation.items()})
    total, ended = 0.0, False
    while not ended:
        observation, reward, _, ended, info = env.step(np.zeros(7, dtype=np.float32))
        total += float(reward)
    print(f"cost {-total:.4g}, last position error {info['position_error']:.3f} m")


if __name__ == "__main__":
    main()
