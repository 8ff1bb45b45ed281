"""The environments by id, for any learning library: ``gym.make("ikgym/Track-v0")``."""

from __future__ import annotations

from typing import Any, ClassVar

from ikgym import scenarios
from ikgym.env import RedundantIKEnv
from ikgym.exceptions import InvalidInputError, UnexpectedArgumentError, UnknownNameError
from ikgym.rl.envs import LearningEnv, LearningVectorEnv
from ikgym.rl.task import Task


class TaskEnv(LearningEnv):
    """An environment by its id; the classes derived from it are the specifications.

    Args:
        render_mode: None, `"human"` or `"rgb_array"`.
        changes: Fields of :class:`ikgym.rl.Task` that differ from those of the id, for ablations.

    Raises:
        UnexpectedArgumentError: There is no such field.
        InvalidInputError: A value is refused.
    """

    task: Task
    metadata: ClassVar[dict[str, Any]] = {**RedundantIKEnv.metadata, "render_fps": 100}  # type: ignore[misc]

    def __init__(self, render_mode: str | None = None, **changes: Any) -> None:
        super().__init__(self.change_task(changes), render_mode)

    @classmethod
    def arms(cls, num_envs: int = 1, **options: Any) -> LearningVectorEnv:
        """N arms, stepped by one kernel; bit for bit a `SyncVectorEnv` of single ones.

        Args:
            num_envs: N.
            options: `autoreset_mode`, `render_mode` and `max_episode_steps` of :class:`ikgym.RedundantIKVectorEnv`,
                and changes as for one arm.
        """
        known = ("autoreset_mode", "render_mode", "max_episode_steps")
        others = {name: options.pop(name) for name in known if name in options}
        return LearningVectorEnv(num_envs, cls.change_task(options), cls.metadata["render_fps"], **others)

    @classmethod
    def change_task(cls, changes: dict[str, Any]) -> Task:
        """The task with other values of some fields.

        Raises:
            UnexpectedArgumentError: There is no such field.
            InvalidInputError: A value is refused, or the scenario has another number of steps, after which Gymnasium
                would end its episodes.
        """
        try:
            task = cls.task.replace(**changes)
        except UnknownNameError as e:
            raise UnexpectedArgumentError(f"got an unexpected keyword argument {e.name!r}. {e}") from None
        scenario, steps = scenarios.find(task.scenario), scenarios.find(cls.task.scenario).steps
        if scenario.steps != steps:
            raise InvalidInputError(
                f"scenario: expected {steps} steps, where Gymnasium ends the episodes of this id, got "
                f"{scenario.steps} of {scenario.name!r}; ikgym.rl.make and make_vec take any scenario."
            )
        return task


class ReachEnv(TaskEnv):
    """A Panda reaches a still pose of the tool from home, at 50 Hz.

    ## Description
    Each episode draws a posture within 1 rad of home; the pose of its tool is the target, 0.3 to 1 m away. Scenario:
    `learning-reach`.

    | other than in `ikgym/Track-v0` | |
    |---|---|
    | observation space | `Box(-5.0, 5.0, (26,), float32)`: indices 0 to 25, of the target; units 0.3 m, 0.3 rad |
    | reward | r = 1 / (1 + √(√c / 30)), 0 in the first 50 steps; in all of them also 50 times the change of r |
    | starting state | home, at rest |
    | episode end | truncated after 100 steps, never terminated |
    | score | of the last 50 steps |
    """

    task = Task("learning-reach", (0.02,), None, half=0.03, steepness=0.5, coarse=0.3, counted=50, progress=50.0)
    metadata: ClassVar[dict[str, Any]] = {**TaskEnv.metadata, "render_fps": 50}  # type: ignore[misc]


class TrackEnv(TaskEnv):
    """A Panda follows random smooth paths of the tool, at 100 Hz.

    ## Description
    Each episode draws a motion of all joints within 1 rad of home, from rest to rest in 2 s. The tool pose of that
    motion is the reference; the joints may move otherwise. Scenario: `learning-track`.

    ## Action space
    `Box(-1.0, 1.0, (7,), float32)`: joint velocities as shares of 0.8 of their limits, 2.175 rad/s in joints 1 to 4
    and 2.61 rad/s in joints 5 to 7. The arm has them at once; its accelerations are not limited.

    ## Observation space
    `Box(-5.0, 5.0, (38,), float32)`:

    | index | meaning | unit |
    |---|---|---|
    | 0 – 6 | joint coordinates from home | 1 rad |
    | 7 – 13 | joint velocities last applied | velocity limit |
    | 14 – 19 | position and orientation error to the reference 1 step ahead, seen from joint 1 | 0.03 m, 0.03 rad |
    | 20 – 25 | hyperbolic tangent of the same | 0.01 m, 0.01 rad |
    | 26 – 37 | indices 14 to 25 for the reference 5 steps ahead | |

    ## Reward
    1 / (1 + c / 25²) of the benchmark's stage cost c = (position error / 1 mm)² + (orientation error / 1 mrad)² + Φ^U,
    with the cost Φ^U of velocities above 0.8 rad/s. 1 is perfect, 1/2 is 25 mm off.

    ## Starting state
    At rest at the first pose of the path.

    ## Episode end
    Truncated after 200 steps; terminated where the tool is more than 0.1 m off.

    ## Score
    :func:`ikgym.rl.score` of the costs of whole episodes: 0 is an arm at rest, 1 the best policy
    without learning that sees as much.
    """

    task = Task()


class FastEnv(TaskEnv):
    """A Panda follows random paths where joint velocities cost as much as errors.

    ## Description
    The paths of `ikgym/Track-v0`. A velocity counts as 1 from 0.3 rad/s on, and with its fourth power: the arm has to
    use its seventh joint, and to be late where that is cheaper. Scenario: `learning-fast`.

    | other than in `ikgym/Track-v0` | |
    |---|---|
    | observation space | `Box(-5.0, 5.0, (38,), float32)` |
    | reward | 1 / (1 + c / 60²), where Φ^U counts velocities above 0.3 rad/s |
    """

    task = Task(scenario="learning-fast", half=0.06)


class LimitsEnv(TaskEnv):
    """A Panda follows random paths for which it needs all of its range and speed.

    ## Description
    Joints may move at 1 rad/s; the motion that is drawn uses all of it, and joints 2 and 4 up to their stops. Scenario:
    `learning-limits`.

    | other than in `ikgym/Track-v0` | |
    |---|---|
    | action space | `Box(-1.0, 1.0, (7,), float32)`: shares of 1 rad/s |
    | observation space | `Box(-5.0, 5.0, (38,), float32)` |
    | reward | r = 1 / (1 + √c / 50), and 30 times the change of r |
    """

    task = Task(scenario="learning-limits", share=1.0, half=0.05, steepness=1.0, progress=30.0)


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
    | reward | 1 / (1 + c / 70²), of the true errors, which are not observed |
    | episode end | truncated after 300 steps |
    """

    task = Task(scenario="learning-camera", history=4, commands=4, share=0.5, half=0.07)


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
    | reward | 1 / (1 + c / 30²), of the true errors |
    | episode end | truncated after 300 steps |
    """

    task = Task(scenario="learning-payload", history=4, commands=4, share=0.5, half=0.03)


#: The environments by id.
IDS: dict[str, type[TaskEnv]] = {
    f"ikgym/{kind.__name__.removesuffix('Env')}-v0": kind
    for kind in (ReachEnv, TrackEnv, FastEnv, LimitsEnv, CameraEnv, PayloadEnv)
}
reach_arms, track_arms, fast_arms = ReachEnv.arms, TrackEnv.arms, FastEnv.arms
limits_arms, camera_arms, payload_arms = LimitsEnv.arms, CameraEnv.arms, PayloadEnv.arms
