"""Foreign policies: objects with the `predict` of Stable-Baselines3 that are no :class:`baselines.SolverPolicy`."""

from __future__ import annotations

import copy
import dataclasses
import time
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Protocol

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from baselines.episodes import Episode, Policy, Recording, Seeds, Tick, begin, check_finite
from baselines.policy import Report
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
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

    def misfit(self, scenario: Scenario, wrap: Wrap | None) -> str | None:
        """Why the spaces of the model do not fit a scenario; None if they do, or if it has none."""
        env = make_env(scenario, self.preview, wrap)
        for kind in ("observation", "action"):
            space, there = getattr(self.model, f"{kind}_space", None), getattr(env, f"{kind}_space")
            if isinstance(space, gym.Space) and _shapes(space) != _shapes(there):
                return f"{self.name} has {kind}s of the shape {_shapes(space)}, the environment of {_shapes(there)}."
        return None


def make_env(scenario: Scenario, preview: Preview, wrap: Wrap | None) -> gym.Env[Any, Any]:
    """The environment of a scenario in its wrappers."""
    bare = gym.make("RedundantIK-v0", scenario=scenario, preview=preview, disable_env_checker=True)
    try:
        env = wrap(bare) if wrap else bare
    except Exception as e:  # whatever the user's code raises
        raise InvalidInputError(f"wrap: raised {type(e).__name__} on {scenario.name}: {e}.") from e
    if not isinstance(env, gym.Env) or env.unwrapped is not bare.unwrapped:
        raise InvalidInputError(f"wrap: expected the environment that it was given in wrappers, got {env!r}.")
    return env


def play_wrapped(
    scenario: Scenario, policy: Policy, wrap: Wrap, seeds: Seeds, *, timed: bool, tick: Tick | None = None
) -> Episode:
    """Plays one episode in a wrapped environment; its record is that of the environment inside.

    Raises:
        InvalidInputError: The episode has a seed besides the reset seed, which wrappers do not pass on; a wrapper
            raises, or changes the episode; an action is not finite.
    """
    seed, state, record = seeds.seed, None, Recording(scenario, [seeds])
    if seeds != Seeds(seed):
        raise InvalidInputError(
            f"wrap: expected an episode that has no seed but the reset seed, got {seeds}; sequences of episodes are "
            "played without wrappers."
        )

    def check(same: bool) -> None:
        if not same:
            raise InvalidInputError(
                f"wrap: expected the episode of {scenario.name} with seed {seed} from its start, got another one: a "
                "wrapper resets without the seed, with options or during the episode, or its step does not make one "
                "step."
            )

    env = make_env(scenario, policy.preview, wrap)
    arm: Simulator = env.unwrapped.simulator  # type: ignore[attr-defined]  # make_env has checked the class
    seen, _ = env.reset(seed=seed)
    start = begin(scenario, [seeds], preview=1, single=True)[0].true_q
    check(env.np_random_seed == seed and np.array_equal(arm.true_q, start))
    policy.predict(copy.deepcopy(seen))  # does not count, see baselines.episodes.rollouts
    for step in range(scenario.steps):
        before = time.perf_counter_ns()
        action, state = policy.predict(seen, state)
        record.time_ns += [time.perf_counter_ns() - before] * timed
        check_finite(action, policy, scenario, [seeds], step)
        seen, _, terminated, truncated, _ = env.step(action)
        left = scenario.steps - step - 1
        check(arm.outcome.remaining[0, 0] == left)
        if left and (terminated or truncated):
            raise InvalidInputError(
                f"wrap: the episode of {scenario.name} ended after {step + 1} of {scenario.steps} steps."
            )
        record.keep(step, arm.outcome, policy.report(state), policy.diagnostics(state))
    if tick is not None:
        tick(scenario.steps)
    return record.episodes()[0]


def _shapes(space: gym.Space[Any]) -> Any:
    """The shape of a space; of a dictionary, the shape of each part."""
    if isinstance(space, gym.spaces.Dict):
        return {name: _shapes(part) for name, part in sorted(space.spaces.items())}
    return space.shape
