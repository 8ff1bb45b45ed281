"""The native vector environment as a `VecEnv` of Stable-Baselines3: ``pip install "ikgym[train]"``."""

from __future__ import annotations

import time
from collections.abc import Sequence
from copy import deepcopy
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode

from ikgym import rl
from ikgym.env import OPTIONS, REPORTED
from ikgym.exceptions import InvalidInputError, MissingDependencyError, NoAttributeError
from ikgym.options import checked_options
from ikgym.scenarios import Preview, Scenario
from ikgym.simulator import Observation
from ikgym.validation import BoolArray
from ikgym.vector_env import RedundantIKVectorEnv

try:
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import VecEnv
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices
except ImportError as error:
    raise MissingDependencyError('ikgym.sb3 needs Stable-Baselines3: pip install "ikgym[train]"') from error

StepReturn = tuple[Observation, npt.NDArray[np.float32], BoolArray, list[dict[str, Any]]]


class RedundantIKVecEnv(VecEnv):
    """N arms in one process, stepped by one compiled kernel, for Stable-Baselines3.

    Observations, rewards (as float32), ends and the episodes drawn after them are bit-identical to those of
    `DummyVecEnv` over N single environments, each in SB3's `Monitor`. Only the infos hold less: that of a row is empty
    except at the end of its episode, where it has the keys of the single environment and

    | key | meaning |
    |---|---|
    | `TimeLimit.truncated` | True: all episodes end by truncation |
    | `terminal_observation` | the last observation; the one returned is already the first of the next episode |
    | `episode` | `r`, `l`, `t`: return, length in steps, time since the environment was made in [s], as of `Monitor` |

    Gymnasium's vector environment, `gym.make_vec(…)`, has another interface, and Stable-Baselines3 refuses it; use this
    class instead.

    As `r` is the sum of the float64 rewards before any wrapper, `env_is_wrapped(Monitor)` is true.

    >>> from stable_baselines3 import PPO
    >>> model = PPO("MultiInputPolicy", RedundantIKVecEnv(64, "varga7-random", preview=(1, 10, 40)))

    Args:
        num_envs: N.
        scenario: A scenario or its name, see `ikgym.scenarios.find`.
        preview: How many steps ahead the nominal coordinates are shown, or which ones.
        commands: How many of the last commands are shown.

    Raises:
        UnknownNameError: There is no such scenario.
        InvalidInputError: N, the scenario, the preview or the number of commands is not valid, there is no memory for N
            arms, or a step may cost more than fits into a float32.
    """

    def __init__(
        self, num_envs: int = 1, scenario: str | Scenario = "varga7-fast", preview: Preview = 2, commands: int = 0
    ) -> None:
        envs = RedundantIKVectorEnv(num_envs, scenario, preview, AutoresetMode.SAME_STEP, commands=commands)
        worst, most = envs.scenario.largest_step_cost(), float(np.finfo(np.float32).max)
        if worst > most:
            raise InvalidInputError(
                f"Scenario {envs.scenario.name!r}: expected steps that cost at most {most:.3g}, since rewards of "
                f"Stable-Baselines3 are in float32, got up to {worst:.3g}."
            )
        self._take(envs)

    def _take(self, envs: RedundantIKVectorEnv) -> None:
        """Sets the vector environment, which begins new episodes in the same step."""
        self._envs, self.scenario = envs, envs.scenario
        self._actions: Any = None
        self._returns, self._lengths = np.zeros(envs.num_envs), np.zeros(envs.num_envs, dtype=np.int64)
        self._made = time.perf_counter()
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)
        self.metadata |= {"render_fps": envs.metadata["render_fps"]}

    def reset(self) -> Observation:
        """Begins episodes in all rows, with the seeds and options of `seed()` and `set_options()`.

        Row i is seeded with seed + i; without a seed its generator continues. An option ``{"q": …}`` of shape
        (n,), in [rad] or [m], starts elsewhere, ``{"arm_seed": k}`` keeps the arm that k draws, ``{"step": k}`` enters
        the episode after k steps.

        Returns:
            The first observations, each of shape (N, …).

        Raises:
            UnknownNameError: There is no such option.
            InvalidInputError: Seeds or options are not valid, or some rows have a start and others do not. The
                episodes continue then, and seeds and options are kept.
        """
        observation: Observation
        observation, _ = self._envs.reset(seed=self._seeds, options=self._checked_options())
        self._reset_seeds()
        self._reset_options()
        self._actions = None
        self._returns[:], self._lengths[:] = 0.0, 0
        return observation

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Takes joint velocities, as fractions of the velocity limit, for the step to come. Shape (N, n)."""
        self._actions = deepcopy(actions)

    def step_wait(self) -> StepReturn:
        """Steps all arms, and begins new episodes in the rows where one has ended.

        Returns:
            Observations, each of shape (N, …); rewards and ends of shape (N,); one info a row.

        Raises:
            ResetNeededError: There has been no reset.
            InvalidInputError: There are no actions, or they are not finite or of a wrong shape. Nothing has changed
                then.
        """
        actions, self._actions = self._actions, None
        observation, rewards, terminated, truncated, final = self._envs.step(actions)
        ended = terminated | truncated
        self._returns += rewards
        self._lengths += 1
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(ended).tolist():
            infos[row] = {
                **{key: _plain(final["final_info"][key][row]) for key in REPORTED if key in final["final_info"]},
                "TimeLimit.truncated": bool(truncated[row] and not terminated[row]),
                "terminal_observation": final["final_obs"][row],
                "episode": self._summary(row),
            }
        self._returns[ended], self._lengths[ended] = 0.0, 0
        return observation, rewards.astype(np.float32), ended, infos

    def close(self) -> None:
        """Does nothing."""
        self._envs.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of rows: `scenario`, `np_random`, spaces and others.

        Raises:
            NoAttributeError: They have no such attribute.
        """
        found = self._envs.get_attr(attr_name)
        return [found[index] for index in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Refused: all arms share their attributes.

        Raises:
            NoAttributeError: Always.
        """
        raise NoAttributeError(f"{attr_name!r} of one arm cannot be set: make another environment.")

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Refused: arms are reset, stepped and drawn together.

        Raises:
            NoAttributeError: Always.
        """
        raise NoAttributeError(f"The arms have no method {method_name!r}: they are reset, stepped and drawn together.")

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper], indices: VecEnvIndices = None) -> list[bool]:
        """True for `Monitor`: SB3 asks whether ``info["episode"]`` holds the return before other wrappers."""
        return [wrapper_class is Monitor for _ in self._get_indices(indices)]

    def _summary(self, row: int) -> dict[str, float]:
        """The summary of an episode by `Monitor`, rounded in the same way."""
        return {
            "r": round(self._returns[row].item(), 6),
            "l": int(self._lengths[row]),
            "t": round(time.perf_counter() - self._made, 6),
        }

    def _checked_options(self) -> dict[str, Any]:
        """The options of all rows as one: each is given for all of them, but `arm_seed` and `step`."""
        if len(self._options) != self.num_envs:
            raise InvalidInputError(f"options: expected {self.num_envs}, one a row, got {len(self._options)}.")
        given = [checked_options(options, OPTIONS) for options in self._options]
        columns = {name: [options.get(name) for options in given] for name in OPTIONS}
        return {name: column for name, column in columns.items() if any(value is not None for value in column)}


class LearningVecEnv(RedundantIKVecEnv):
    """N arms of :func:`ikgym.rl.make_vec`, for Stable-Baselines3.

    As :class:`RedundantIKVecEnv`, but `TimeLimit.truncated` is False where a track is lost, and `episode` holds the
    return of the rewards that the agent sees.

    Args:
        num_envs: N.
        task: Observation, action and reward.
        render_mode: None or `"rgb_array"`.
        render_fps: Pictures per second of a video.

    Raises:
        UnknownNameError: There is no such scenario.
        InvalidInputError: A value is refused.
    """

    def __init__(
        self, num_envs: int, task: rl.Task, render_mode: str | None = None, render_fps: int | None = None
    ) -> None:
        self.task = task
        mode = AutoresetMode.SAME_STEP
        self._take(rl.LearningVectorEnv(num_envs, task, render_fps, autoreset_mode=mode, render_mode=render_mode))

    def get_images(self) -> Sequence[npt.NDArray[np.uint8] | None]:
        """One picture a row, for `VecVideoRecorder` and `render()`."""
        return self._envs.render() or ()


def make_vec(
    env: str | Scenario | None = None, num_envs: int = 1, *, render_mode: str | None = None, **changes: Any
) -> LearningVecEnv:
    """N arms, for learning, for Stable-Baselines3.

    >>> from stable_baselines3 import PPO
    >>> model = PPO("MlpPolicy", make_vec("panda-random", 8))
    >>> model = PPO("MlpPolicy", make_vec("ikgym/Track-v0", 8))

    Args:
        env: A scenario or its name, see `ikgym.scenarios.find`, also by the keyword `scenario`; or an environment by
            its id, whose N single ones in a `DummyVecEnv` are the same bit for bit.
        num_envs: N.
        render_mode: None or `"rgb_array"`.
        changes: Fields of :class:`ikgym.rl.Task` with other values.

    Raises:
        UnknownNameError: There is no such scenario or field.
        InvalidInputError: A value is refused.
    """
    kind = rl.IDS.get(env.removeprefix("ikgym:")) if isinstance(env, str) else None
    if kind is not None:
        return LearningVecEnv(num_envs, kind.change_task(changes), render_mode, kind.metadata["render_fps"])
    if env is not None and "scenario" in changes:
        raise InvalidInputError(f"scenario: expected one, got {env!r} and {changes['scenario']!r}.")
    given = {} if env is None else {"scenario": env}
    return LearningVecEnv(num_envs, rl.Task().replace(**given, **changes), render_mode)


def _plain(value: Any) -> Any:
    """A Python number, as a single environment reports it, or an array."""
    return value.item() if value.ndim == 0 else value
