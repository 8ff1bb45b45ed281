"""Foreign policies: objects with the `predict` of Stable-Baselines3 that are no :class:`baselines.SolverPolicy`."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Protocol

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from baselines.episodes import Seeds, Simulation
from baselines.policy import Report
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.simulation import Outcome
from ikgym.scenarios import Preview, Scenario
from ikgym.simulator import Simulator
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
        env = self.environment(scenario)
        shown, needed = env.observation_space, env.action_space
        for kind, attribute, there in (
            ("observations", "observation_space", shown),
            ("actions", "action_space", needed),
        ):
            space = getattr(self.model, attribute, None)
            if isinstance(space, gym.Space) and _shapes(space) != _shapes(there):
                return f"{self.name} has {kind} of the shape {_shapes(space)}, the environment of {_shapes(there)}."
        return None

    def environment(self, scenario: Scenario) -> gym.Env[Any, Any]:
        """The environment in its wrappers."""
        bare = gym.make("RedundantIK-v0", scenario=scenario, preview=self.preview, disable_env_checker=True)
        try:
            env = self.wrap(bare) if self.wrap else bare
        except Exception as e:  # whatever the user's code raises
            raise InvalidInputError(f"wrap: raised {type(e).__name__} on {scenario.name}: {e}.") from e
        if not isinstance(env, gym.Env) or env.unwrapped is not bare.unwrapped:
            raise InvalidInputError(f"wrap: expected the environment that it was given in wrappers, got {env!r}.")
        return env


class WrappedEnvironment:
    """An episode in a wrapped environment; outcomes are those of the environment inside.

    Seeds other than the reset seed cannot be passed through wrappers.

    Args:
        policy: A policy that is played in wrappers.
        scenario: The scenario.
        seeds: The seeds of one episode.
        **options: Those of :class:`baselines.episodes.Simulation`.

    Raises:
        InvalidInputError: The episode has other seeds; a wrapper raises, or changes the episode.
    """

    def __init__(self, policy: Any, scenario: Scenario, seeds: Sequence[int | Seeds], **options: Any) -> None:
        self._seeds = Seeds.of(seeds[0])
        if self._seeds != Seeds(self._seeds.seed):
            raise InvalidInputError(
                f"wrap: expected an episode that has no seed but the reset seed, got {self._seeds}; sequences of "
                "episodes are played without wrappers."
            )
        self._scenario, self._steps = scenario, 0
        self._env: gym.Env[Any, Any] = policy.environment(scenario)
        self._arm: Simulator = self._env.unwrapped.simulator
        self.seen, _ = self._env.reset(seed=self._seeds.seed)
        start = Simulation(scenario, seeds, preview=1, single=True).true_q
        self._check(self._env.np_random_seed == self._seeds.seed and np.array_equal(self._arm.true_q, start))

    def step(self, action: npt.NDArray[Any]) -> Outcome:
        """Makes one step."""
        self.seen, _, terminated, truncated, _ = self._env.step(action)
        self._steps, out = self._steps + 1, self._arm.outcome
        self._check(int(out.remaining[0, 0]) == self._scenario.steps - self._steps)
        if (terminated or truncated) and self._steps < self._scenario.steps:
            raise InvalidInputError(
                f"wrap: the episode of {self._scenario.name} ended after {self._steps} of {self._scenario.steps} steps."
            )
        return out

    def _check(self, same: bool) -> None:
        if not same:
            raise InvalidInputError(
                f"wrap: expected the episode of {self._scenario.name} with seed {self._seeds.seed} from its start, got "
                "another one: a wrapper resets without the seed, with options or during the episode, or its step does "
                "not make one step."
            )


def _shapes(space: gym.Space[Any]) -> Any:
    """The shape of a space; of a dictionary, the shape of each part."""
    if isinstance(space, gym.spaces.Dict):
        return {name: _shapes(part) for name, part in sorted(space.spaces.items())}
    return space.shape
