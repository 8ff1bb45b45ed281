"""A callback for those who train with Stable-Baselines3 themselves: what the validation split says, in the logs."""

from __future__ import annotations

from typing import Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from baselines.episodes import Seeds, add_up
from baselines.evaluation.entrants import Wrap, entrant
from baselines.evaluation.runner import play_episodes
from baselines.evaluation.summary import geometric_mean
from baselines.fingerprints import fingerprint
from baselines.oracle import best_known
from baselines.training.validation import reference_costs, validation_seeds
from ikgym import scenarios
from ikgym.scenarios import Preview, Scenario
from ikgym.validation import whole_number


class ValidationCallback(BaseCallback):
    """Plays episodes of the validation split now and then, and logs what they cost.

    | in TensorBoard | meaning |
    |---|---|
    | `validation/cost` | geometric mean of the costs |
    | `validation/cost_ratio` | the same over the best known costs, or those of the reference that `ikgym train` has; absent where there is neither |
    | `validation/position_error_max_mm` | mean over the episodes of their largest position error |
    | `validation/position_error_rms_mm` | root mean square over all steps |
    | `validation/orientation_error_max_mrad` | as that of the position; absent where the task has none |

    `rollout/ep_rew_mean` is what Stable-Baselines3 logs by itself: minus the mean cost of the last training episodes.

    >>> model = PPO("MultiInputPolicy", RedundantIKVecEnv(64, "varga7-random"), tensorboard_log="runs/mine")
    >>> model.learn(1_000_000, callback=ValidationCallback("varga7-random", every=100_000))

    Args:
        scenario: What is to be tracked, as :func:`ikgym.scenarios.find` takes it.
        every: Steps of training, those of all arms together, between two validations.
        episodes: How many; a deterministic scenario has one.
        preview: What the agent is shown, as its environment was made.
        wrap: Wraps the environment for the agent, ``wrap(env) -> env``, as it was trained; costs and errors are those
            below the wrappers.

    Raises:
        UnknownNameError: There is no such scenario.
        InvalidInputError: A number is not valid.
    """  # noqa: E501  # a table

    def __init__(
        self,
        scenario: str | Scenario,
        every: int,
        episodes: int = 8,
        preview: Preview = 2,
        wrap: Wrap | None = None,
    ) -> None:
        super().__init__()
        self._scenario, self._preview, self._wrap = scenarios.find(scenario), preview, wrap
        self._every = whole_number("every", every, at_least=1)
        self._seeds = validation_seeds(self._scenario, whole_number("episodes", episodes, at_least=1))
        self._known = _known_costs(self._scenario, self._seeds)
        self._due = 0

    def _on_step(self) -> bool:
        if self.num_timesteps >= self._due:
            self._due = self.num_timesteps + self._every
            for name, value in self._measured().items():
                self.logger.record(f"validation/{name}", value)
        return True

    def _measured(self) -> dict[str, float]:
        scenario, draws = self._scenario, [Seeds(seed) for seed in self._seeds]
        one = entrant(self.model, wrap=self._wrap)
        player: Any = one.make(scenario, one.for_episode(scenario, draws[0]), self._preview)
        episodes = play_episodes(scenario, player, draws, one.shown(player, self._preview), timed=False)
        costs = np.array([float(add_up(e.tracking_cost + e.velocity_cost)) for e in episodes])
        errors = np.array([e.position_error for e in episodes])
        out = {
            "cost": geometric_mean(costs.tolist()),
            "position_error_max_mm": 1e3 * float(errors.max(axis=1).mean()),
            "position_error_rms_mm": 1e3 * float(np.sqrt(np.mean(errors**2))),
        }
        if scenario.task.has_orientation:
            angles = [e.orientation_error.max() for e in episodes]
            out["orientation_error_max_mrad"] = 1e3 * float(np.mean(angles))
        if self._known is not None:
            out["cost_ratio"] = geometric_mean((costs / self._known).tolist())
        return out


def _known_costs(scenario: Scenario, seeds: tuple[int, ...]) -> Any:
    """Costs that those of an agent are divided by, None where some are not known. Shape (N,)."""
    best = best_known.costs(scenario, seeds if scenario.random else [0])
    if all(cost is not None for cost in best):
        return np.array(best)
    return reference_costs(fingerprint(scenario), seeds)
