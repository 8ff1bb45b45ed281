"""An own reward and an own observation, by Gymnasium's wrappers around one arm, and around many."""

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import vector

import baselines
import ikgym  # noqa: F401  # registers the environment

SCENARIO = "varga7-slow"


def bounded(reward: np.ndarray) -> np.ndarray:
    """Rewards between -1 and 0: costs of a lost arm are no larger than those of a poor one."""
    return np.tanh(1e-3 * reward)


def tool_error(observation: dict) -> dict:
    """The joint coordinates, and the position error at the next step in [mm]."""
    # Positions are the last three of all task coordinates.
    missing = observation["nominal"][..., 0, -3:] - observation["pose"][..., -3:]
    return {"q": observation["q"], "missing": 1e3 * missing}


def space(inner: gym.spaces.Dict) -> gym.spaces.Dict:
    """The space of these observations."""
    return gym.spaces.Dict({"q": inner["q"], "missing": gym.spaces.Box(-np.inf, np.inf, (3,), np.float64)})


def one() -> gym.Env:
    """One arm, wrapped."""
    env = gym.make("RedundantIK-v0", scenario=SCENARIO, preview=1)
    env = gym.wrappers.TransformObservation(env, tool_error, space(env.observation_space))
    return gym.wrappers.TransformReward(env, lambda reward: float(bounded(reward)))


def many(num_envs: int) -> gym.vector.VectorEnv:
    """Several arms, stepped by one kernel and wrapped together."""
    envs = gym.make_vec("RedundantIK-v0", num_envs=num_envs, scenario=SCENARIO, preview=1)
    single = space(envs.single_observation_space)
    envs = vector.TransformObservation(envs, tool_error, single_observation_space=single)
    return vector.TransformReward(envs, bounded)


def main() -> None:
    """Compares wrapped rewards with the costs below them."""
    env = one()
    observation, _ = env.reset(seed=0)
    _, reward, *_, info = env.step(np.zeros(7, dtype=np.float32))
    print(f"one arm: missing {observation['missing'].round(3)} mm, reward {reward:.3g}")
    print(f"the cost stays in info: {info['tracking_cost'] + info['velocity_cost']:.4g}")

    envs = many(4)
    envs.reset(seed=0)
    _, rewards, *_ = envs.step(np.zeros((4, 7), dtype=np.float32))
    print(f"four arms: rewards {np.array2string(rewards, precision=3)}")

    # Scores are those below the wrappers: an own reward changes what is learned, not what is measured.
    total = baselines.track(SCENARIO, "dls", steps=50).total_cost
    print(f"dls costs {total:.4g} in 50 steps, whatever it was rewarded by")


if __name__ == "__main__":
    main()
