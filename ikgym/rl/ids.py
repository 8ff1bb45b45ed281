"""The environments by id, for any learning library: ``gym.make("ikgym/Track-v0")``."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from ikgym.env import RedundantIKEnv
from ikgym.rl.making import Task
from ikgym.scenarios import Scenario

Features = npt.NDArray[np.float32]
Action = npt.NDArray[np.float32]


class TaskEnv(gym.Env[Features, Action]):
    """An arm in the wrappers of :mod:`ikgym.rl`; the classes derived from it are the specifications.

    Args:
        render_mode: None, `"human"` or `"rgb_array"`.
        changes: Fields of :class:`ikgym.rl.Task` that differ from those of the id, for ablations.

    Raises:
        UnknownNameError: There is no such field.
        InvalidInputError: A value is refused.
    """

    task: ClassVar[Task]
    #: Steps of an episode, and the return of one whose score is about 0.8.
    steps: ClassVar[int]
    reward_threshold: ClassVar[float]
    metadata: ClassVar[dict[str, Any]] = {**RedundantIKEnv.metadata, "render_fps": 100}  # type: ignore[misc]

    def __init__(self, render_mode: str | None = None, **changes: Any) -> None:
        task = self.task.replace(**changes)
        self._env = task.arm(render_mode=render_mode)
        self.render_mode = render_mode
        self.observation_space, self.action_space = self._env.observation_space, self._env.action_space

    @classmethod
    def arms(cls, num_envs: int = 1, *, render_mode: str | None = None, **options: Any) -> Any:
        """N arms, stepped by one kernel; bit for bit a `SyncVectorEnv` of single ones.

        Args:
            num_envs: N.
            render_mode: None or `"rgb_array"`.
            options: `autoreset_mode` and `max_episode_steps` of :class:`ikgym.RedundantIKVectorEnv`, and changes as
                for one arm.
        """
        own = {name: options.pop(name) for name in ("autoreset_mode", "max_episode_steps") if name in options}
        task = cls.task.replace(**options)
        return task.arms(num_envs, render_mode=render_mode, **own)

    @property
    def scenario(self) -> Scenario:
        """The tracking problem."""
        scenario: Scenario = self._env.unwrapped.scenario  # type: ignore[attr-defined]  # of the environment
        return scenario

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Features, dict[str, Any]]:
        """Begins an episode; for the options see :class:`ikgym.RedundantIKEnv`."""
        super().reset(seed=seed)
        self._env.unwrapped.np_random = self.np_random  # one generator, whoever asks for it
        return self._env.reset(options=options)

    def step(self, action: Action) -> tuple[Features, float, bool, bool, dict[str, Any]]:
        """One step; `info` is that of :class:`ikgym.RedundantIKEnv`, whose costs are the benchmark's."""
        observation, reward, terminated, truncated, info = self._env.step(action)
        return observation, float(reward), terminated, truncated, info

    def render(self) -> Any:
        """Draws the arm, see :meth:`ikgym.RedundantIKEnv.render`."""
        return self._env.render()

    def close(self) -> None:
        """Closes the window, if there is one."""
        self._env.close()


class ReachEnv(TaskEnv):
    """A Panda reaches a still pose of the tool from home, at 50 Hz.

    ## Description
    Each episode draws a posture within 1 rad of home; the pose of its tool is the target, 0.3 to 1 m away. Scenario:
    `learning-reach`.

    | other than in `ikgym/Track-v0` | |
    |---|---|
    | observation space | `Box(-5.0, 5.0, (26,), float32)`: indices 0 to 25, of the target; units 0.3 m, 1 rad |
    | reward | 1 − log(1 + d² + Φ^U) / log(1 + 300²): 0 is 0.3 m off |
    | starting state | home, at rest |
    | episode end | truncated after 100 steps, never terminated |
    | score | of the last 50 steps |
    """

    task, steps, reward_threshold = (
        Task(scenario="learning-reach", ahead=(0.02,), lost_distance=None, zero=0.3, counted=50),
        100,
        60.0,
    )
    metadata: ClassVar[dict[str, Any]] = {**TaskEnv.metadata, "render_fps": 50}  # type: ignore[misc]


class TrackEnv(TaskEnv):
    """A Panda follows random smooth paths of the tool, at 100 Hz.

    ## Description
    Each episode draws a motion of all joints within 1 rad of home, from rest to rest in 2 s. The tool pose of that
    motion is the reference; the joints may move otherwise. Scenario: `learning-track`.

    ## Action space
    `Box(-1.0, 1.0, (7,), float32)`: joint velocities as shares of 0.6 of their limits, 2.175 rad/s in joints 1 to 4
    and 2.61 rad/s in joints 5 to 7. The arm's limits of acceleration hold on top.

    ## Observation space
    `Box(-5.0, 5.0, (38,), float32)`:

    | index | meaning | unit |
    |---|---|---|
    | 0 – 6 | joint coordinates from home | half of a joint's range |
    | 7 – 13 | joint velocities last applied | velocity limit |
    | 14 – 19 | position and orientation error to the reference 1 step ahead, seen from joint 1 | 0.1 m, 0.33 rad |
    | 20 – 25 | hyperbolic tangent of the same | 0.01 m, 0.033 rad |
    | 26 – 37 | indices 14 to 25 for the reference 5 steps ahead | |

    ## Reward
    1 − log(1 + d² + Φ^U) / log(1 + 100²), with d² = (position error / 1 mm)² + (orientation error / 3.3 mrad)² and
    the cost Φ^U of velocities above 1.09 rad/s. 1 is perfect, 0 is 0.1 m off.

    ## Starting state
    At rest at the first pose of the path.

    ## Episode end
    Truncated after 200 steps; terminated where the tool is more than 0.1 m off.

    ## Score
    :func:`ikgym.rl.score` of the costs of whole episodes: 0 is an arm that stands still, 1 is tuned `dls`.
    """

    task, steps, reward_threshold = Task(), 200, 160.0


class FastEnv(TaskEnv):
    """A Panda follows random paths where joint velocities cost as much as errors.

    ## Description
    The paths of `ikgym/Track-v0`. A velocity counts as 1 from 0.3 rad/s on, and with its fourth power: the arm has to
    use its seventh joint, and to be late where that is cheaper. Scenario: `learning-fast`.

    | other than in `ikgym/Track-v0` | |
    |---|---|
    | observation space | `Box(-5.0, 5.0, (38,), float32)` |
    | reward | Φ^U counts velocities above 0.3 rad/s |
    """

    task, steps, reward_threshold = Task(scenario="learning-fast"), 200, 100.0


class LimitsEnv(TaskEnv):
    """A Panda follows random paths for which it needs all of its range and speed.

    ## Description
    Joints may move at 1 rad/s; the motion that is drawn uses all of it, and joints 2 and 4 up to their stops. Scenario:
    `learning-limits`.

    | other than in `ikgym/Track-v0` | |
    |---|---|
    | action space | `Box(-1.0, 1.0, (7,), float32)`: shares of 1 rad/s |
    | observation space | `Box(-5.0, 5.0, (38,), float32)` |
    """

    task, steps, reward_threshold = Task(scenario="learning-limits", share=1.0), 200, 150.0


class CameraEnv(TaskEnv):
    """A Panda whose kinematics differ from the model follows gentle paths, seen by a slow camera.

    ## Description
    Joint zeros (10 mrad), axes (5 mrad) and links (2 mm) deviate, drawn anew each episode. A camera measures the pose
    each 3 steps, shows it 2 steps late with noise of 1 mm and 2 mrad, and loses a tenth. Scenario: `learning-camera`.

    | other than in `ikgym/Track-v0` | |
    |---|---|
    | action space | shares of half of the velocity limits |
    | observation space | `Box(-5.0, 5.0, (272,), float32)`: the last four observations, newest first; \
after index 37 each has the ages of joint coordinates and pose in units of ten steps, and the last four commands in \
units of the velocity limit |
    | reward | of the true errors, which are not observed |
    | episode end | truncated after 300 steps |
    """

    task, steps, reward_threshold = Task(scenario="learning-camera", history=4, commands=4, share=0.5), 300, 150.0


class PayloadEnv(TaskEnv):
    """A Panda takes up a payload half-way, which bends all of its joints.

    ## Description
    From step 150 on every joint is 20 mrad from where it is measured. A camera measures the pose each 3 steps.
    Scenario: `learning-payload`.

    | other than in `ikgym/Track-v0` | |
    |---|---|
    | action space | shares of half of the velocity limits |
    | observation space | `Box(-5.0, 5.0, (272,), float32)`: the last four observations, newest first; \
after index 37 each has the ages of joint coordinates and pose in units of ten steps, and the last four commands in \
units of the velocity limit |
    | reward | of the true errors |
    | episode end | truncated after 300 steps |
    """

    task, steps, reward_threshold = Task(scenario="learning-payload", history=4, commands=4, share=0.5), 300, 150.0


#: The environments by id.
IDS: dict[str, type[TaskEnv]] = {
    f"ikgym/{kind.__name__.removesuffix('Env')}-v0": kind
    for kind in (ReachEnv, TrackEnv, FastEnv, LimitsEnv, CameraEnv, PayloadEnv)
}
reach_arms, track_arms, fast_arms = ReachEnv.arms, TrackEnv.arms, FastEnv.arms
limits_arms, camera_arms, payload_arms = LimitsEnv.arms, CameraEnv.arms, PayloadEnv.arms


def register() -> None:
    """Registers the ids with Gymnasium, which takes native vectors of them as well."""
    for name, kind in IDS.items():
        short = kind.__name__.removesuffix("Env").lower()
        gym.register(
            id=name,
            entry_point=f"{__name__}:{kind.__name__}",
            vector_entry_point=f"{__name__}:{short}_arms",
            reward_threshold=kind.reward_threshold,
            max_episode_steps=kind.steps,
        )
