"""An own reward and an own observation, by Gymnasium's wrappers around one arm or many."""

import gymnasium as gym
import numpy as np

import baselines
import ikgym  # noqa: F401  # registers the environment

SCENARIO = "varga7-slow"


def bounded(reward: float) -> float:
    """A reward between -1 and 0: costs of a lost arm are no larger than those of a poor one."""
    return float(np.tanh(1e-3 * reward))


class ToolError(gym.ObservationWrapper):
    """The agent sees its posture, and what is missing in the tool's position at the next step, in [mm]."""

    def __init__(self, env: gym.Env) -> None:
        super().__init__(env)
        inner, bound = env.observation_space, np.float64(np.inf)
        self.observation_space = gym.spaces.Dict(
            {"q": inner["q"], "missing": gym.spaces.Box(-bound, bound, (3,), np.float64)}
        )

    def observation(self, observation: dict) -> dict:
        """What the agent sees instead."""
        # Positions are the last three of all task coordinates.
        missing = observation["nominal"][0, -3:] - observation["pose"][-3:]
        return {"q": observation["q"], "missing": 1e3 * missing}


def main() -> None:
    env = gym.make("RedundantIK-v0", scenario=SCENARIO, preview=1)
    env = gym.wrappers.TransformReward(ToolError(env), bounded)
    observation, _ = env.reset(seed=0)
    observation, reward, *_, info = env.step(np.zeros(7, dtype=np.float32))
    print(f"one arm: missing {observation['missing'].round(3)} mm, reward {reward:.3g}")
    print(f"the cost stays in info: {info['tracking_cost'] + info['velocity_cost']:.4g}")

    # Vector wrappers do the same to many arms that are stepped in one kernel.
    envs = gym.make_vec("RedundantIK-v0", num_envs=4, scenario=SCENARIO, preview=1)
    envs = gym.wrappers.vector.TransformReward(envs, lambda rewards: np.tanh(1e-3 * rewards))
    envs.reset(seed=0)
    _, rewards, *_ = envs.step(np.zeros((4, 7), dtype=np.float32))
    print(f"four arms: rewards {np.round(rewards, 9)}")

    # Scores are those below the wrappers: an own reward changes what is learned, not what is measured.
    total = baselines.track(SCENARIO, "dls", steps=50).total_cost
    print(f"dls costs {total:.4g} in 50 steps, whatever it was rewarded by")


if __name__ == "__main__":
    main()
