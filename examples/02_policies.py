"""Two policies on the same random episodes, by Stable-Baselines3's `evaluate_policy`."""

import gymnasium as gym
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor

import baselines
import ikgym


def main() -> None:
    """Prints the mean return of two policies."""
    scenario = ikgym.scenarios.get("varga7-random").replace(steps=300)
    for name, parameters in [("dls", {"damping": 1e-2}), ("rhc_gradient", {"gradient": "analytic"})]:
        policy = baselines.make(name, scenario, **parameters)
        env = Monitor(gym.make("RedundantIK-v0", scenario=scenario, preview=policy.preview))
        env.reset(seed=7)
        mean, spread = evaluate_policy(policy, env, n_eval_episodes=3)
        print(f"{name}: return {mean:.4g} ± {spread:.2g}")


if __name__ == "__main__":
    main()
