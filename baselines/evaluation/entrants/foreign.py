"""Policies of others, such as models of Stable-Baselines3: whatever has such a `predict`, as the loop calls it."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Protocol

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from baselines.episodes import Episode, Seeds, Tick, check_finite
from baselines.policy import Report
from baselines.status import Status
from ikgym.env import RedundantIKEnv
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview, Scenario
from ikgym.spaces import action_space, observation_space
from ikgym.validation import FloatArray

#: Wraps the environment, as an agent that was trained on a wrapped one needs it.
Wrap = Callable[[gym.Env[Any, Any]], gym.Env[Any, Any]]


class Predictor(Protocol):
    """Whatever chooses actions with the signature of Stable-Baselines3."""

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = False,
    ) -> tuple[Any, Any]:
        """An action and the state for the next call."""


@dataclasses.dataclass(frozen=True, eq=False)
class ForeignPolicy:
    """A policy of somebody else. What it does not say of itself is left empty, never guessed.

    It is called for one arm at a time, with ``deterministic=True``.

    Args:
        name: What messages and rows call it.
        model: Who chooses the actions.
        preview: Steps ahead that it is shown, or which ones.
        wrap: Wraps the environment; None where it plays the environment as it is.
        parameters: Its parameters, as far as they are known.
    """

    name: str
    model: Predictor
    preview: Preview
    commands: ClassVar[int] = 0
    batched: ClassVar[bool] = False
    wrap: Wrap | None = None
    parameters: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def predict(self, observation: Any, state: Any = None, episode_start: Any = None) -> tuple[npt.NDArray[Any], Any]:
        """The action for one arm, and what the next call is to be given; an episode_start says that an episode begins.

        Raises:
            InvalidInputError: The model raises an error, or answers with something else than numbers and a state.
        """
        memory, start = (None, True) if state is None else (state[0], episode_start is not None)
        try:
            answer = self.model.predict(observation, state=memory, episode_start=np.array([start]), deterministic=True)
        except Exception as e:  # whatever the code of somebody else raises
            raise InvalidInputError(f"{self.name}: predict raised {type(e).__name__}: {e}.") from e
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise InvalidInputError(f"{self.name}: expected predict to return (action, state), got {answer!r}.")
        action = np.asarray(answer[0])
        if action.dtype.kind not in "fiub":
            raise InvalidInputError(f"{self.name}: expected an action of numbers, got {answer[0]!r}.")
        # Models without a memory return None, which is what the first call is told by.
        return action, (answer[1],)

    def report(self, state: Any) -> Report:
        """Nothing is known of how an action came about. Shapes (1,)."""
        del state
        return Report(np.array([int(Status.UNKNOWN)]), np.zeros(1, dtype=np.int64))

    def diagnostics(self, state: Any) -> dict[str, FloatArray]:
        """Nothing."""
        del state
        return {}

    def misfit(self, scenario: Scenario) -> str | None:
        """Why the model does not fit a scenario, as far as it has spaces that tell; None where it does, or may.

        Raises:
            InvalidInputError: The preview is not valid, or the environment cannot be wrapped.
        """
        shown: gym.Space[Any]
        asked: gym.Space[Any]
        if self.wrap is None:
            shown, asked = observation_space(scenario, self.preview), action_space(scenario)
        else:
            env, _ = self.environment(scenario)
            shown, asked = env.observation_space, env.action_space
        for what, own, there in (
            ("observations", getattr(self.model, "observation_space", None), shown),
            ("actions", getattr(self.model, "action_space", None), asked),
        ):
            if isinstance(own, gym.Space) and _shapes(own) != _shapes(there):
                return f"{self.name} has {what} of the shape {_shapes(own)}, the environment of {_shapes(there)}."
        return None

    def environment(self, scenario: Scenario) -> tuple[gym.Env[Any, Any], Recorder]:
        """The environment with its wrappers, and what keeps what happens in it.

        Raises:
            InvalidInputError: The preview is not valid, or the environment cannot be wrapped.
        """
        assert self.wrap is not None
        made = gym.make("RedundantIK-v0", scenario=scenario, preview=self.preview, disable_env_checker=True)
        recorder = Recorder(made)
        try:
            env = self.wrap(recorder)
        except Exception as e:  # whatever the code of somebody else raises
            raise InvalidInputError(f"wrap: raised {type(e).__name__} on {scenario.name}: {e}.") from e
        if not isinstance(env, gym.Env) or env.unwrapped is not made.unwrapped:
            raise InvalidInputError(f"wrap: expected the environment that it was given in wrappers, got {env!r}.")
        return env, recorder


class Recorder(gym.Wrapper[Any, Any, Any, Any]):
    """Keeps what happens in an environment in float64, below the wrappers that others put around it.

    Args:
        env: The environment, as :func:`gymnasium.make` makes it.
    """

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        base = env.unwrapped
        assert isinstance(base, RedundantIKEnv)
        self.steps = base.scenario.steps
        self.rows: list[tuple[FloatArray, ...]] = []
        self._seeds: list[int | None] = []

    @property
    def ended(self) -> bool:
        """Whether the episode is over."""
        return len(self.rows) == self.steps

    def check(self, seed: int) -> None:
        """Sees to it that wrappers have begun the episode that is to be played.

        Raises:
            InvalidInputError: The seed has not arrived, or wrappers have taken steps.
        """
        if self._seeds != [seed] or self.rows:
            raise InvalidInputError(
                f"wrap: expected reset(seed={seed}) to reach the environment once and no step to be made, got resets "
                f"with the seeds {self._seeds} and {len(self.rows)} steps."
            )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins the episode.

        Raises:
            InvalidInputError: Wrappers start elsewhere than the scenario, or break the episode off.
        """
        if options:
            raise InvalidInputError(f"wrap: expected resets without options, got {options!r}.")
        if 0 < len(self.rows) < self.steps:
            raise InvalidInputError(f"wrap: the episode was reset after {len(self.rows)} of {self.steps} steps.")
        if not self.ended:
            self._seeds.append(seed)
        return self.env.reset(seed=seed)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """One step, kept."""
        result = self.env.step(action)
        seen, info = result[0], result[-1]
        if not self.ended:
            numbers = [info[key] for key in ("tracking_cost", "velocity_cost", "position_error")]
            numbers.append(info.get("orientation_error", math.nan))  # absent where the task has none
            # Copies: wrappers may write into what they are handed.
            copies = [seen[key].copy() for key in ("q", "qdot", "pose")]
            self.rows.append((*copies, *map(np.asarray, numbers), info["at_limit"].astype(np.float64)))
        return result


def play_wrapped(
    scenario: Scenario, policy: ForeignPolicy, seed: int | Seeds, *, timed: bool = True, tick: Tick | None = None
) -> Episode:
    """Plays one episode in the wrapped environment; costs and errors are those below the wrappers, in float64.

    Args:
        scenario: What is to be tracked.
        policy: Who tracks it, with a `wrap`.
        seed: The reset seed, or what is drawn how, as far as a reset without options can say it.
        timed: Whether to keep the times of the calls.
        tick: See :data:`baselines.episodes.Tick`.

    Raises:
        InvalidInputError: The environment cannot be wrapped, the episode ends early, or an action is refused.
    """
    draw = Seeds.of(seed)
    if draw != Seeds(draw.seed):
        raise InvalidInputError(f"wrap: expected an episode that its reset seed says all of, got {draw}.")
    env, recorder = policy.environment(scenario)
    seen, _ = env.reset(seed=draw.seed)
    recorder.check(draw.seed)
    state, times, over = None, [], False
    while not (recorder.ended or over):
        begin = time.perf_counter_ns()
        action, state = policy.predict(seen, state)
        times.append(time.perf_counter_ns() - begin)
        check_finite(action, policy, scenario, [draw], len(recorder.rows))
        seen, _, terminated, truncated, _ = env.step(action)
        over = terminated or truncated
    if not recorder.ended:
        raise InvalidInputError(
            f"wrap: the episode of {scenario.name} ended after {len(recorder.rows)} of {scenario.steps} steps."
        )
    if tick is not None:
        tick(scenario.steps)
    q, qdot, pose, tracking, velocity, position, orientation, at_limit = map(np.array, zip(*recorder.rows, strict=True))
    return Episode(
        q,
        qdot,
        pose,
        tracking,
        velocity,
        position,
        orientation,
        at_limit,
        status=np.full(scenario.steps, int(Status.UNKNOWN)),
        iterations=np.zeros(scenario.steps, dtype=np.int64),
        time_ns=np.array(times if timed else [], dtype=np.int64),
        diagnostics={},
    )


def _shapes(space: gym.Space[Any]) -> Any:
    """The shape of a space, by key where it has parts."""
    if isinstance(space, gym.spaces.Dict):
        return {name: _shapes(part) for name, part in sorted(space.spaces.items())}
    return space.shape
