"""A scenario from a file, changed, saved under another name, and tracked by a solver."""

import tempfile
from pathlib import Path

import gymnasium as gym

import baselines
import ikgym

FILE = Path(__file__).with_name("planar4.toml")


def main() -> None:
    """Tracks the scenario of a file, and a slower copy."""
    scenario = ikgym.scenarios.load(FILE)
    slower = scenario.replace(name="planar4-slow", trajectory=scenario.trajectory.replace(frequency=1.0))
    with tempfile.TemporaryDirectory() as folder:
        slower.save(Path(folder) / "planar4-slow.toml")
        for file in (FILE, Path(folder) / "planar4-slow.toml"):
            policy = baselines.make("dls", str(file))
            env = gym.make("RedundantIK-v0", scenario=str(file), preview=policy.preview)
            observation, _ = env.reset()
            state, cost, ended = None, 0.0, False
            while not ended:
                action, state = policy.predict(observation, state)
                observation, reward, _, ended, _ = env.step(action)
                cost -= float(reward)
            print(f"{file.name}: cost {cost:.4g}")


if __name__ == "__main__":
    main()
