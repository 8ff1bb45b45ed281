"""N arms whose actions say how a damped inverse is weighed, for some steps at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.features import Features
from baselines.training.environment.null_space import null_maps
from baselines.training.environment.view import aligned
from baselines.training.gradients.arms import Arms, Indices
from baselines.training.gradients.law import Law
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, NoAttributeError, ResetNeededError
from ikgym.rl.twists import twist_size
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, flag, number, whole_number

#: Steps for which an inverse is held while an action is. Held as long as the action, it would cost more than it should.
INVERSE_EVERY = 2
#: Of all arms.
ALL = slice(None)
#: What agents see.
SEEN = Bilinear(damping=1e-2, matrix=False)


class InverseVecEnv(VecEnv):
    """N arms that follow their paths by a weighted damped inverse, of which an agent says what is free.

    An action is what the network of a :class:`Bilinear` without `matrix` gives: the null motion h, ln λ and ln U, each
    within ±1. It is held for `hold` steps, with feedback at each of them. Noise of exploration then moves the arm in its
    null space, rather than off its path, and is the same for long enough to count. The steps between two actions are one
    call of the kernel that gradients go through, see :mod:`baselines.training.gradients.segment`.

    | | |
    |---|---|
    | observation | the features of the processing; for critics, what rewards depend on beside them |
    | reward | −k ln(1 + c/k), with c the mean cost of these steps ÷ that of the reference joint path, and k = `log_above` |
    | terminated | the episode is over, which the features show ahead |
    | truncated | the arm is farther than `lost_distance` from its path, on which it then goes on; it gains nothing by that |

    >>> from stable_baselines3 import TD3
    >>> model = TD3("MlpPolicy", InverseVecEnv(64, "panda-random"))

    Features say nothing of the velocities of the joints, which changes of velocity are counted from, nor of what the
    reference joint path costs, and rewards depend on both. `privileged` shows them, and a policy of
    :mod:`baselines.training.policies.asymmetric` hides them from the actor: they are for the critics.

    Episodes differ in cost by more than an action does. Of `group_size` arms all play the same episodes, each with its
    own actions: how much better one does than the others is due to the actions alone (groups of rollouts from the same
    state as in the vine of TRPO, Schulman et al. 2015, and in GRPO, Shao et al. 2024).

    Args:
        num_envs: N. A reset spreads them over their episodes.
        scenario: A scenario or what names one, see `ikgym.scenarios.find`; its plant is ideal.
        processing: What is seen; without `matrix`.
        hold: Steps of an action, a divisor of those of the scenario.
        lost_distance: In [m], above 0.
        privileged: Whether n + 1 numbers are shown behind the features: the velocities of the joints ÷ the speed of
            what is ahead, and the logarithm of the mean cost of the reference joint path, of 1 where there is none.
        log_above: k, above 0: costs well below k times that mean count as they are, those above by their logarithm.
        group_size: Arms that play the same episodes, one after the other; N is a multiple. Where there is no reference
            joint path it is 1.
        null_map: Whether the last r n numbers shown are what :func:`null_maps` gives, row by row, for a policy of
            :mod:`baselines.training.policies.null_space`. The task has to leave joints free then.

    Attributes:
        seen: How many numbers of an observation are features.
        freedom: r, how many joints the task leaves free.
        group_size: Arms that play the same episodes.

    Raises:
        UnknownNameError: There is no such scenario.
        InvalidInputError: A value is refused, or the scenario is none that gradients could go through.
    """  # noqa: E501  # a table

    def __init__(
        self,
        num_envs: int,
        scenario: str | Scenario,
        processing: Bilinear = SEEN,
        hold: int = 20,
        lost_distance: float = 0.05,
        privileged: bool = False,
        log_above: float = 1.0,
        group_size: int = 1,
        null_map: bool = False,
    ) -> None:
        scenario = scenarios.find(scenario)
        if processing.matrix:
            raise InvalidInputError("processing: expected one without a matrix, got one with it.")
        self._hold = whole_number("hold", hold, at_least=1)
        if scenario.steps % self._hold:
            raise InvalidInputError(
                f"hold: expected a divisor of the {scenario.steps} steps of an episode, got {hold}."
            )
        self._lost_distance = number("lost_distance", lost_distance, above=0.0)
        self._log_above = number("log_above", log_above, above=0.0)
        self.group_size = whole_number("group_size", group_size, at_least=1)
        if num_envs % self.group_size:
            raise InvalidInputError(f"num_envs: expected a multiple of group_size, {group_size}, got {num_envs}.")
        if self.group_size > 1 and scenario.nominal_joint_path(scenarios.SPLITS["train"].start) is None:
            # Where an arm that is lost begins anew, and its group does not.
            raise InvalidInputError(
                f"group_size: expected 1 without a reference joint path, as in {scenario.name!r}, got {group_size}."
            )
        self._law, self.scenario, self.processing = Law(scenario, processing), scenario, processing
        self.freedom = scenario.joints - int(twist_size(self._law.task.kind))
        self._null_map = flag("null_map", null_map)
        if self._null_map and self.freedom < 1:
            raise InvalidInputError(f"null_map: expected false where the task takes all joints, got {null_map}.")
        self._arms = Arms(scenario, num_envs, processing.offsets)
        self._features = torch.zeros(num_envs, self._law.inputs, dtype=torch.float64)
        self._speed = np.ones(num_envs)
        self._generator, self._reset = np.random.default_rng(), False
        self._returns, self._lengths = np.zeros(num_envs), np.zeros(num_envs, dtype=np.int64)
        self.seen, self._privileged = self._law.inputs, flag("privileged", privileged)
        observed = self.seen + (scenario.joints + 1 if privileged else 0)
        observed += self.freedom * scenario.joints if null_map else 0
        unbounded = spaces.Box(-np.inf, np.inf, (observed,), np.float32)
        self.render_mode = None
        super().__init__(num_envs, unbounded, spaces.Box(-1.0, 1.0, (self._law.outputs,), np.float32))

    def seed(self, seed: int | None = None) -> list[int | None]:
        """The seed of all episodes from the next reset on."""
        self._generator = np.random.default_rng(seed)
        return [seed] * self.num_envs

    def reset(self) -> Features:
        """Begins new episodes, spread over their steps, of the split `train`. Returns shape (N, f)."""
        self._arms.spread(self._generator, self._hold, self.group_size)
        self._returns[:], self._lengths[:] = 0.0, 0
        self._reset = True
        return self._see()

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Takes actions. Shape (N, 2 n + 1).

        Raises:
            InvalidInputError: They have another shape, or are not finite.
            ResetNeededError: Nothing has been reset yet.
        """
        if not self._reset:
            raise ResetNeededError("Actions need something that was seen: call reset() first.")
        given = np.asarray(actions, dtype=np.float64)
        if given.shape != (self.num_envs, self._law.outputs) or not np.isfinite(given).all():
            raise InvalidInputError(
                f"actions: expected finite numbers of shape {(self.num_envs, self._law.outputs)}, got {actions!r}."
            )
        self._actions = np.clip(given, -1.0, 1.0)

    def step_wait(self) -> tuple[Features, npt.NDArray[np.float32], npt.NDArray[np.bool_], list[dict[str, Any]]]:
        """Moves all arms by `hold` steps, and begins new episodes where one has ended.

        Returns:
            Features of shape (N, f), rewards and ends of shape (N,), one info a row.
        """
        arms = self._arms
        costs, distance = self._move()
        rewards = -self._log_above * np.log1p(costs / self._log_above)
        over, lost = arms.ended, distance > self._lost_distance
        self._returns += rewards
        self._lengths += self._hold
        ends = over | lost
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        seen = self._see()
        if ends.any():
            rows = np.flatnonzero(ends)
            for row, last in zip(rows.tolist(), seen[rows], strict=True):
                summary = {"r": float(self._returns[row]), "l": int(self._lengths[row])}
                truncated = bool(not over[row])
                infos[row] = {"terminal_observation": last, "episode": summary, "TimeLimit.truncated": truncated}
            self._returns[ends], self._lengths[ends] = 0.0, 0
            arms.give_up(np.flatnonzero(lost & ~over))
            arms.begin_new(np.flatnonzero(over), self._generator, group_size=self.group_size)
            seen[rows] = self._see(rows)
        return seen, rewards.astype(np.float32), ends, infos

    def close(self) -> None:
        """Nothing is open; closing does nothing."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute that all rows share.

        Raises:
            NoAttributeError: They have none of that name.
        """
        if not hasattr(self, attr_name):
            raise NoAttributeError(f"{type(self).__name__} has no attribute {attr_name!r}.")
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Rows have no attributes of their own.

        Raises:
            NoAttributeError: Always.
        """
        raise NoAttributeError(f"{attr_name}: the arms of {type(self).__name__} have no attributes of their own.")

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Rows have no methods of their own.

        Raises:
            NoAttributeError: Always.
        """
        raise NoAttributeError(f"{method_name}: the arms of {type(self).__name__} have no methods of their own.")

    def env_is_wrapped(self, wrapper_class: Any, indices: VecEnvIndices = None) -> list[bool]:
        """No row is wrapped."""
        return [False for _ in self._get_indices(indices)]

    def _see(self, rows: Indices | slice = ALL) -> Features:
        """What some arms show where they are. Shape (R, observed)."""
        self._look(rows)
        arms, features = self._arms, self._features[rows]
        seen = [features.numpy()]
        if self._privileged:
            seen.append(arms.qdot[rows].numpy() / self._speed[rows, None])
            seen.append(np.log(arms.usual[rows, None]))
        if self._null_map:
            seen.append(null_maps(self._law, arms.q[rows], features).reshape(len(features), -1))
        return aligned(np.concatenate(seen, axis=1).astype(np.float32))

    def _look(self, rows: Indices | slice = ALL) -> None:
        """Features of where some arms are, and the speed of what is ahead."""
        arms = self._arms
        with torch.no_grad():
            features, speed = self._law.features(arms.q[rows], arms.ahead[rows], arms.remaining[rows])
        self._features[rows], self._speed[rows] = features, speed

    def _move(self) -> tuple[FloatArray, FloatArray]:
        """The mean cost of each arm, ÷ that of its reference joint path, and how far it is from its path in [m]."""
        arms, spent, outputs = self._arms, self._arms.spent.copy(), torch.from_numpy(self._actions)
        for begun in range(0, self._hold, INVERSE_EVERY):
            steps = min(INVERSE_EVERY, self._hold - begun)
            if begun:
                at = arms.q.numpy(), arms.ahead, arms.remaining
                self._law.see(*at, self._features.numpy(), self._speed, for_network=False)
            with torch.no_grad():
                held = self._law.held(arms.q, self._features, outputs)
                rows = arms.rows(steps, self._speed)
                arms.q, arms.qdot, cost, distance = self._law.move(arms.q, arms.qdot, held, rows)
            arms.advance(rows.steps, cost)
        return (arms.spent - spent) / (self._hold * arms.usual), distance
