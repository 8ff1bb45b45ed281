"""Foreign policies: objects with the `predict` of Stable-Baselines3 that are no :class:`baselines.SolverPolicy`."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Protocol

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from baselines.episodes import Tick, check_finite, rollout
from baselines.policy import Report
from baselines.recording import Episode, Seeds
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview, Scenario
from ikgym.spaces import action_space, observation_space
from ikgym.validation import FloatArray

#: Wraps the environment, as an agent needs it that was trained in a wrapped one.
Wrap = Callable[[gym.Env[Any, Any]], gym.Env[Any, Any]]


class Predictor(Protocol):
    """An object with the `predict` of Stable-Baselines3."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """An action and the state for the next call."""


@dataclasses.dataclass(frozen=True, eq=False)
class ForeignPolicy:
    """A foreign policy. Properties that it does not state are left empty, never guessed.

    It is called for one arm at a time, with ``deterministic=True``.
    """

    name: str
    model: Predictor
    preview: Preview
    commands: ClassVar[int] = 0
    batched: ClassVar[bool] = False
    wrap: Wrap | None = None
    parameters: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def predict(self, observation: Any, state: Any = None, episode_start: Any = None) -> tuple[npt.NDArray[Any], Any]:
        """The action for one arm, and the state for the next call; an episode begins where `episode_start` is given."""
        memory, start = (None, True) if state is None else (state[0], episode_start is not None)
        try:
            answer = self.model.predict(observation, state=memory, episode_start=np.array([start]), deterministic=True)
        except Exception as e:  # whatever the user's code raises
            raise InvalidInputError(f"{self.name}: predict raised {type(e).__name__}: {e}.") from e
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise InvalidInputError(f"{self.name}: expected predict to return (action, state), got {answer!r}.")
        action = np.asarray(answer[0])
        if action.dtype.kind not in "fiub":
            raise InvalidInputError(f"{self.name}: expected an action of numbers, got {answer[0]!r}.")
        # Models without a memory return None, which marks the first call.
        return action, (answer[1],)

    def report(self, state: Any) -> Report:
        """Nothing is known. Shapes (1,)."""
        del state
        return Report(np.array([int(Status.UNKNOWN)]), np.zeros(1, dtype=np.int64))

    def diagnostics(self, state: Any) -> dict[str, FloatArray]:
        """None."""
        del state
        return {}

    def misfit(self, scenario: Scenario) -> str | None:
        """Why the spaces of the model do not fit a scenario; None if they do, or if it has none."""
        shown: gym.Space[Any]
        needed: gym.Space[Any]
        if self.wrap is None:
            shown, needed = observation_space(scenario, self.preview), action_space(scenario)
        else:
            env, _ = self.environment(scenario)
            shown, needed = env.observation_space, env.action_space
        for kind, own, there in (
            ("observations", getattr(self.model, "observation_space", None), shown),
            ("actions", getattr(self.model, "action_space", None), needed),
        ):
            if isinstance(own, gym.Space) and _shapes(own) != _shapes(there):
                return f"{self.name} has {kind} of the shape {_shapes(own)}, the environment of {_shapes(there)}."
        return None

    def environment(self, scenario: Scenario) -> tuple[gym.Env[Any, Any], Recorder]:
        """The environment in its wrappers, and the recorder inside of them."""
        assert self.wrap is not None
        made = gym.make("RedundantIK-v0", scenario=scenario, preview=self.preview, disable_env_checker=True)
        recorder = Recorder(made)
        try:
            env = self.wrap(recorder)
        except Exception as e:  # whatever the user's code raises
            raise InvalidInputError(f"wrap: raised {type(e).__name__} on {scenario.name}: {e}.") from e
        if not isinstance(env, gym.Env) or env.unwrapped is not made.unwrapped:
            raise InvalidInputError(f"wrap: expected the environment that it was given in wrappers, got {env!r}.")
        return env, recorder


class Recorder(gym.Wrapper[Any, Any, Any, Any]):
    """Records the actions that reach an environment through other wrappers, and their tracking costs."""

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self.seeds: list[int | None] = []
        self.actions: list[npt.NDArray[Any]] = []
        self.costs: list[float] = []

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins the episode and records the seed."""
        self.seeds.append(seed)
        return self.env.reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Makes one step and records it."""
        result = self.env.step(action)
        self.actions.append(np.array(action))
        self.costs.append(result[-1]["tracking_cost"])
        return result


class _Recorded:
    """Chooses recorded actions, one after the other."""

    def __init__(self, actions: Sequence[npt.NDArray[Any]]) -> None:
        self._actions = actions

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """The action of the step; the state counts steps."""
        del observation, episode_start, deterministic
        step = state or 0
        return self._actions[step], step + 1


def play_wrapped(
    scenario: Scenario, policy: ForeignPolicy, seed: int | Seeds, *, timed: bool = True, tick: Tick | None = None
) -> Episode:
    """Plays one episode in the wrapped environment. Its actions, played again without wrappers, give the record.

    Seeds other than the reset seed cannot be passed through wrappers.
    """
    seeds = Seeds.of(seed)
    if seeds != Seeds(seeds.seed):
        raise InvalidInputError(f"wrap: expected an episode that has no seed but the reset seed, got {seeds}.")
    env, recorder = policy.environment(scenario)
    seen, _ = env.reset(seed=seeds.seed)
    if recorder.seeds != [seeds.seed] or recorder.actions:
        raise InvalidInputError(
            f"wrap: expected reset(seed={seeds.seed}) to reach the environment once and no step to be made, got resets "
            f"with the seeds {recorder.seeds} and {len(recorder.actions)} steps."
        )
    state, times, over = None, [], False
    while not over and len(recorder.actions) < scenario.steps:
        begin = time.perf_counter_ns()
        action, state = policy.predict(seen, state)
        times.append(time.perf_counter_ns() - begin)
        check_finite(action, policy, scenario, [seeds], len(recorder.actions))
        seen, _, terminated, truncated, _ = env.step(action)
        over = terminated or truncated
    if len(recorder.actions) != scenario.steps:
        raise InvalidInputError(
            f"wrap: the episode of {scenario.name} ended after {len(recorder.actions)} of {scenario.steps} steps."
        )
    again = dataclasses.replace(policy, model=_Recorded(recorder.actions))
    episode = rollout(scenario, again, seeds, timed=False, tick=tick)
    if not np.array_equal(episode.tracking_cost, recorder.costs):
        raise InvalidInputError(
            f"wrap: expected the episode of {scenario.name} with seed {seeds.seed} from its start, got another one: a "
            "wrapper resets with options or during the episode."
        )
    return dataclasses.replace(episode, time_ns=np.array(times if timed else [], dtype=np.int64))


def _shapes(space: gym.Space[Any]) -> Any:
    """The shape of a space; of a dictionary, the shape of each part."""
    if isinstance(space, gym.spaces.Dict):
        return {name: _shapes(part) for name, part in sorted(space.spaces.items())}
    return space.shape
