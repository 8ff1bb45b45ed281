"""An arm from a Denavit–Hartenberg table, a trajectory for it, and a solver on both."""

import gymnasium as gym
import numpy as np

import baselines
import ikgym


def main() -> None:
    """Tracks a wave with an arm of its own."""
    arm = ikgym.arms.from_dh(
        "planar4",
        a=[0.4, 0.3, 0.3, 0.2],
        d=[0.0, 0.0, 0.0, 0.0],
        alpha=[0.0, 0.0, 0.0, 0.0],
        theta=[0.3, 0.6, 0.6, 0.6],
    )
    scenario = ikgym.Scenario(
        "planar4-wave",
        arm,
        ikgym.tasks.get("pose"),
        ikgym.trajectories.Sinusoid(amplitude=np.array([0.3, 0.4, 0.5, 0.6]), frequency=2.0),
        velocity_limit=np.full(4, 5.0),
        steps=1000,
    )
    policy = baselines.make("dls", scenario)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=policy.preview)
    observation, _ = env.reset()
    state, worst, ended = None, 0.0, False
    while not ended:
        action, state = policy.predict(observation, state)
        observation, _, _, ended, info = env.step(action)
        worst = max(worst, info["position_error"])
    print(f"largest position error {1e6 * worst:.1f} µm")


if __name__ == "__main__":
    main()
