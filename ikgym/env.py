"""The environment: one arm tracks one nominal trajectory."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec

from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, ResetNeededError
from ikgym.kernels.outcome import OBSERVED as OBSERVED
from ikgym.kernels.outcome import Observation, observation
from ikgym.options import checked_options
from ikgym.scenarios import Preview, Scenario
from ikgym.simulator import Simulator
from ikgym.spaces import action_space, observation_space
from ikgym.validation import FloatArray, number

#: The keys of `info` after a step; the orientation error is there where the task has an orientation.
REPORTED = ("tracking_cost", "velocity_cost", "position_error", "orientation_error", "clipped", "at_limit", "time")
#: The keys that the options of a reset may have.
OPTIONS = ("q", "arm_seed", "step")


class Arms:
    """The base of single and vector environments: scenario, states of the arms, their pictures, the specification."""

    def _set_arms(
        self,
        scenario: str | Scenario,
        rows: int | None,
        preview: Preview,
        commands: int,
        lost_distance: float | None,
        render_mode: str | None,
    ) -> tuple[spaces.Dict, spaces.Box]:
        """Takes the arguments of an environment; returns the observation and the action space of one arm."""
        self.scenario, self.render_mode = scenarios.find(scenario), render_mode
        self._spec: EnvSpec | None = None
        self._most_steps = self.scenario.steps
        # First, since it checks the memory.
        self._simulator = Simulator(self.scenario, rows, preview, commands=commands)
        self.lost_distance = None if lost_distance is None else number("lost_distance", lost_distance, above=0.0)
        self._renderers: list[Renderer] = []
        if render_mode is not None:
            from ikgym.rendering import Renderer  # matplotlib is slow to import

            self._renderers = [Renderer(self.scenario, render_mode) for _ in range(rows or 1)]
        return observation_space(self.scenario, preview, commands), action_space(self.scenario)

    def _record(self, row: int, position_error: float, orientation_error: float, *, begins: bool = False) -> None:
        """Records the state of a row, which may begin an episode, for its pictures; errors in [m] and [rad]."""
        simulator, renderer = self._simulator, self._renderers[row]
        if begins:
            renderer.begin(simulator.nominal_positions(row))
        step, q = int(simulator.steps_made[row]), simulator.true_q[row]
        renderer.add(step, q, position_error, orientation_error, simulator.obstacles(row))

    @property
    def preview(self) -> tuple[int, ...]:
        """Steps ahead at which the reference is shown."""
        return self._simulator.preview

    @property
    def spec(self) -> EnvSpec | None:  # an attribute of the bases, which gym.make() and gym.make_vec() set
        """The specification, with the steps of an episode, which only the scenario knows; None without `gym.make`."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = None if spec is None else dataclasses.replace(spec, max_episode_steps=self._most_steps)


class RedundantIKEnv(Arms, gym.Env[Any, Any]):
    """Trajectory tracking with a redundant robot arm.

    ## Description
    The tool of an arm is to follow a nominal trajectory that is known some steps ahead. At each step the policy
    chooses the joint velocities, and pays for the tracking error and for high velocities: the stage cost of a
    receding-horizon controller (Varga 2021). A scenario holds all that defines the problem. For learning there are
    environments with rewards of size 1: `ikgym/Track-v0` and others, see :mod:`ikgym.rl.ids`.

    ## Action space
    | action | space | unit |
    |---|---|---|
    | joint velocity as a fraction of the scenario's `velocity_limit` | `Box(-1.0, 1.0, (n,), float32)` | 1 |

    `velocity_limit` is in [rad/s], in [m/s] for a prismatic joint: that of the arm, unless the scenario says otherwise.
    An action outside the box is clipped, and `info["clipped"]` says so. An action that is not finite or of a wrong
    shape is an error; the state stays as it was.

    ## Transition
    q(k+1) = q(k) + Δt q̇(k) (Varga 2021, eq. 5), where the command becomes the joint velocity q̇, joint by joint, in
    this order:

    1. The command of an earlier step takes its place, if the scenario's plant has a delay.
    2. It is cut to the arm's velocity limit.
    3. Its change from the q̇ last applied is cut to the acceleration limit times Δt. An episode begins at rest. This
       is q̇, which is observed and enters the cost; the effects below do not.
    4. The drive lags behind it, bias and noise are added, and backlash lies between drive and joint, if the plant has
       some.
    5. A joint that would pass a limit of its coordinate stops there, whatever the acceleration limit says. Its q̇ is
       (q(k+1) − q(k)) / Δt then, no faster than the velocity limit: 0 where it stood at the stop already.
    6. Where the scenario has collisions, a motion in which bodies touch is not made: the arm is stopped for the rest
       of the episode (protective stop). The path continues, and costs.

    An ideal plant without limits applies the command. `info["at_limit"]` counts the joints that were held back, by
    more than a millionth of the scenario's `velocity_limit`, which exceeds the rounding of float32.

    ## Observation space
    A `Dict` of float64:

    | key | shape | meaning | unit |
    |---|---|---|---|
    | `q` | (n,) | joint coordinates | [rad], [m] |
    | `qdot` | (n,) | joint velocities last applied | [rad/s], [m/s] |
    | `pose` | (m,) | measured task coordinates | [m], rotation parts 1 |
    | `nominal` | (p, m) | nominal task coordinates ahead | [m], rotation parts 1 |
    | `remaining` | (1,) | steps left in the episode | 1 |
    | `q_age` | (1,) | steps since `q` was measured; where sensors are slow or late | 1 |
    | `pose_age` | (1,) | steps since `pose` was measured; where sensors are slow or late | 1 |
    | `commands` | (h, n) | the last h commands within the velocity limit, newest first; with `commands=h` | as `qdot` |
    | `obstacles` | (o, 16) | obstacles after the coming step; where they move or are drawn | [m], rotation parts 1 |

    `q` and `pose` are the measurements of the scenario's plant; with an ideal plant they are exact. `qdot` is that of
    transition 3, or of 5 at a stop: late where commands are, without lag and noise. Policies that keep acceleration
    limits use it in the first step of an episode alone, and then the last command, which they remember.
    `preview` = an int p gives X^N(k+1) … X^N(k+p); a tuple such as (1, 10, 40, 120) gives only those steps.
    A row of `obstacles` has a rotation, row by row, a position, half of the edges and a radius, see
    :class:`ikgym.kernels.bodies.Surroundings`. The nominal continues past the end of the episode. All bounds are finite
    and true: they follow from the start, the limits, the number of steps and the arm's reach.

    ## Reward
    −(Φ^X(X^N(k+1) − F(q(k+1))) + Φ^U(q̇(k))), minus the stage cost of the scenario's `TrackingCost`, of the true joint
    coordinates and the kinematics of the arm that moves; so are the errors in `info`. A scenario may add
    a `ProximityCost` for bodies that come near. Where a scenario holds its nominal points for several steps, only the
    last step of each point costs anything.

    ## Info
    | key | meaning | unit |
    |---|---|---|
    | `tracking_cost` | Φ^X | 1 |
    | `velocity_cost` | Φ^U | 1 |
    | `position_error` | distance of the tool point from its nominal position | [m] |
    | `orientation_error` | angle to the nominal orientation, or axis; absent where the task has none | [rad] |
    | `clipped` | whether the action left its box | bool |
    | `at_limit` | joints held back by a stop, by the velocity limit, by the acceleration limit; int64 (3,) | 1 |
    | `time` | time since the start | [s] |

    Where the scenario has collisions, `clearance` is the smallest signed distance between bodies in [m], and
    `collision` is true for an arm that was stopped since bodies touched. Where it has a `ProximityCost`,
    `proximity_cost` is that of the clearance, Φ^C.

    After a reset `info` is empty, except for `context`, float64 (c,), where the plant draws numbers from ranges, see
    :class:`ikgym.Plant`: -1 at the lower end of a range, 1 at the upper end. No policy of the benchmark sees it.

    ## Starting state
    The scenario's start, with no velocity. `reset(seed=…)` chooses the trajectory of a random scenario, and all random
    effects of its plant; see `ikgym.scenarios.SPLITS` for the seeds. Options of a reset:

    - `{"arm_seed": k}` uses the arm and the drives that k draws, for this episode, whatever the seed; it is an error
      where the plant draws neither.
    - `{"q": …}` starts elsewhere, within the limits of the arm. A joint without limits starts at most 2π [rad] or [m]
      from home (or as far as the start of the scenario, if that is farther).
    - `{"step": k}` enters the episode after k steps, on its reference joint path and at its velocity; with `q`, at that
      posture and at rest. Sensor and drive histories are initialised as if the arm had been there before. It is an
      error where the reference is a path of the tool alone.

    ## Episode end
    Truncated by the environment itself after the scenario's `steps`, also given by `spec.max_episode_steps`. Terminated
    where the position error exceeds `lost_distance`, or bodies touch, if there is such a distance.

    Args:
        scenario: A scenario, or its name: a registered one, a file ending in `.toml`, or
            `"package.module:attribute"`; see `ikgym.scenarios.find`.
        preview: Steps ahead at which the nominal coordinates are shown.
        render_mode: None, `"human"` (a window) or `"rgb_array"`.
        commands: h, the number of past commands shown.
        lost_distance: Position error in [m] beyond which the episode ends; None for never.

    Raises:
        UnknownNameError: There is no such scenario.
        InvalidInputError: The scenario, the preview, the number of commands, the distance or the render mode is not
            valid, or there is no memory for the steps.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}  # type: ignore[misc]

    def __init__(
        self,
        scenario: str | Scenario = "varga7-fast",
        preview: Preview = 2,
        render_mode: str | None = None,
        commands: int = 0,
        lost_distance: float | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise InvalidInputError(
                f"render_mode: expected None or one of {self.metadata['render_modes']}, got {render_mode!r}."
            )
        one = self._set_arms(scenario, None, preview, commands, lost_distance, render_mode)
        self.observation_space, self.action_space = one
        self._step, self._ended = -1, True  # no episode yet
        self._steps, self._dt = self.scenario.steps, self.scenario.dt
        self._has_orientation = self.scenario.task.has_orientation

    @property
    def simulator(self) -> Simulator:
        """The arm with its true state, which no observation shows."""
        return self._simulator

    @property
    def context(self) -> FloatArray:
        """Numbers that the plant has drawn from ranges, see :class:`ikgym.plant.DrawnPlant`. Shape (c,)."""
        context: FloatArray = self._simulator.context[0].copy()
        return context

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins an episode.

        Args:
            seed: Chooses the trajectory of a random scenario, and whatever its plant draws.
            options: ``{"q": …}`` starts at other joint coordinates, in [rad] or [m], of shape (n,); ``{"arm_seed": k}``
                has the arm and the drives that k draws, whatever the seed; ``{"step": k}`` enters the episode after k
                steps, on its reference joint path.

        Returns:
            The first observation, and an info that is empty or has the context.

        Raises:
            UnknownNameError: There is no such option.
            InvalidInputError: The options are no dict; the start has a wrong shape, is not finite or outside the
                limits; the seed of the arm is none, or the plant draws no arm; there is no such step or joint path.
        """
        options = checked_options(options, OPTIONS)
        chosen = self._simulator.check_options(options)
        super().reset(seed=seed)
        self._simulator.reset(np.ones(1, dtype=np.bool_), [self.np_random], **chosen)
        self._ended = True  # until it is certain that the arm touches nothing
        out = self._simulator.observe()
        self._step, self._ended = int(self._simulator.steps_made[0]), False
        if self._renderers:
            self._record(0, float(out.position_error[0]), float(out.orientation_error[0]), begins=True)
        return observation(out, 0), {"context": self.context} if self.context.size else {}

    def step(self, action: npt.ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Applies joint velocities for one time step; see the class for the returned values.

        Raises:
            ResetNeededError: There is no episode, or it has ended.
            InvalidInputError: The action is not finite or of a wrong shape; the state stays as it was.
        """
        if self._ended:
            raise ResetNeededError(
                "step() needs an episode: call reset() first."
                if self._step < 0
                else f"The episode has ended after {self._step} steps: call reset() first."
            )
        seen, (tracking, velocity, position, orientation, clipped), held, met = self._simulator.step_one(action)
        self._step += 1
        info: dict[str, Any] = {
            "tracking_cost": tracking,
            "velocity_cost": velocity,
            "position_error": position,
        }
        # A NaN differs from itself, and Gymnasium's checker compares infos: an error that does not exist is left out.
        if self._has_orientation:
            info["orientation_error"] = orientation
        info["clipped"] = clipped > 0.0
        info["at_limit"] = held
        info["time"] = self._step * self._dt
        cost = tracking + velocity
        if met:
            info["clearance"], info["collision"] = met[0], met[1] > 0.0
            cost += met[2]
        if self.scenario.proximity is not None:
            info["proximity_cost"] = met[2]
        if self._renderers:
            self._record(0, position, orientation)
        ends, over = self.lost_distance is not None, self._step == self._steps
        lost = ends and (position > self.lost_distance or bool(met and met[1] > 0.0))  # type: ignore[operator]
        self._ended = lost or over
        return seen, -cost, lost, over, info

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Draws the arm, the nominal and the actual path, and the error over time.

        Returns:
            The picture in mode ``"rgb_array"``, of shape (height, width, 3); None in mode ``"human"``.

        Raises:
            ResetNeededError: There is no episode yet.
        """
        if not self._renderers:
            gym.logger.warn("render() draws nothing without a render_mode; give one to gym.make().")
            return None
        if self._step < 0:
            raise ResetNeededError("render() needs an episode: call reset() first.")
        return self._renderers[0].draw()

    def close(self) -> None:
        """Closes the window, if there is one."""
        for renderer in self._renderers:
            renderer.close()
