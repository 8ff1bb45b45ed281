"""The native vector environment: many arms in one kernel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from ikgym.env import OPTIONS, Arms, RedundantIKEnv
from ikgym.exceptions import InvalidInputError, NoAttributeError, ResetNeededError
from ikgym.kernels.outcome import Observation, Outcome, observation
from ikgym.options import checked_mask, checked_mode, checked_options, checked_seeds
from ikgym.rows import Hinting, Infos, contexts, infos_of, last_observations, lost_rows
from ikgym.scenarios import Preview, Scenario
from ikgym.validation import BoolArray, FloatArray, whole_number


class RedundantIKVectorEnv(
    Arms, gym.vector.VectorEnv[Observation, npt.NDArray[np.float32], npt.NDArray[Any]], metaclass=Hinting
):
    """N times :class:`ikgym.RedundantIKEnv`, stepped by one compiled kernel.

    Observation, action, reward, info and end of an episode are those of the single environment, with a leading axis of
    N. Over whole episodes all of it is bit-identical to `SyncVectorEnv`, in every autoreset mode, with seeds seed + i.

    | `autoreset_mode` | effect on a row whose episode has ended |
    |---|---|
    | `NEXT_STEP` | the next step resets it: its action is ignored, its reward is 0, it has no info |
    | `SAME_STEP` | it is reset at once: the last observation and info are in `final_obs` and `final_info` |
    | `DISABLED` | it must be reset with a mask before the next step, which is an error otherwise |

    `get_attr` has the attributes of single environments; no row is stepped or drawn alone.

    `reset(options={"reset_mask": mask})` resets just the rows where the mask, a Boolean array of shape (N,), is true;
    `{"q": …}` starts elsewhere, with shape (n,) for all rows or (N, n); `{"arm_seed": …}` keeps arms, and
    `{"step": …}` enters episodes after that many steps, one number for all rows or one a row.

    Args:
        num_envs: N.
        scenario: A scenario or its name, see `ikgym.scenarios.find`.
        preview: Steps ahead at which the nominal coordinates are shown.
        autoreset_mode: A mode of Gymnasium, or its value such as ``"SameStep"``.
        render_mode: None or `"rgb_array"`: :meth:`render` draws each row, which Gymnasium's `RecordVideo` of vector
            environments puts side by side.
        max_episode_steps: Steps after which an episode is truncated, if that is before its end; None for its end.
        commands: h, the number of past commands shown.
        lost_distance: Position error in [m] beyond which an episode ends; None for never.

    Raises:
        UnknownNameError: There is no such scenario or autoreset mode.
        InvalidInputError: N, the scenario, the preview, the render mode, the distance, the number of steps or of
            commands is not valid, or there is no memory for N arms.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | Scenario = "varga7-fast",
        preview: Preview = 2,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        commands: int = 0,
        lost_distance: float | None = None,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise InvalidInputError(
                f"render_mode: expected None or 'rgb_array' for the vector environment, got {render_mode!r}; a window "
                "shows a single one."
            )
        self.num_envs = whole_number("num_envs", num_envs, at_least=1)
        self.autoreset_mode = checked_mode(autoreset_mode)
        specific = {"render_modes": ["rgb_array"], "autoreset_mode": self.autoreset_mode}
        self.metadata = RedundantIKEnv.metadata | specific
        one = self._set_arms(scenario, self.num_envs, preview, commands, lost_distance, render_mode)
        if max_episode_steps is not None:
            self._most_steps = min(self._most_steps, whole_number("max_episode_steps", max_episode_steps, at_least=1))
        self.single_observation_space, self.single_action_space = one
        self.observation_space, self.action_space = (batch_space(space, self.num_envs) for space in one)
        self._generators: dict[int, np.random.Generator] = {}
        self._seeds: dict[int, int] = {}
        self._begun = np.zeros(self.num_envs, dtype=np.bool_)
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        self._entered = np.zeros(self.num_envs, dtype=np.int64)

    @property
    def context(self) -> FloatArray:
        """The contexts of the rows' episodes. Shape (N, c)."""
        return self._simulator.context

    @property  # type: ignore[misc]  # read-only and one a row, as SyncVectorEnv has it
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The rows' generators, made from fresh entropy where there was no seed."""
        return tuple(self._generator(row)[0] for row in range(self.num_envs))

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seeds of the rows' generators."""
        return tuple(self._generator(row)[1] for row in range(self.num_envs))

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, Infos]:
        """Begins episodes, in all rows or in those of a mask.

        Args:
            seed: Row i is seeded with seed + i, or with the i-th of a sequence; None continues with its generator.
            options: ``{"reset_mask": …}`` of shape (N,), ``{"q": …}`` of shape (n,) or (N, n), ``{"arm_seed": …}`` one
                number for all rows, or one a row, None where the arm is drawn with the episode, ``{"step": …}``
                likewise, None where an episode begins.

        Returns:
            The observations of all rows, and infos that are empty or have the contexts of the rows that begin.

        Raises:
            UnknownNameError: There is no such option.
            InvalidInputError: Seeds, mask, starts, seeds of arms or steps are of a wrong shape or type. Nothing has
                changed then.
            ResetNeededError: The mask leaves out a row that has never been reset.
        """
        options = checked_options(options, (*OPTIONS, "reset_mask"))
        seeds = checked_seeds(seed, self.num_envs)
        mask = checked_mask(options.get("reset_mask"), self.num_envs)
        if not (self._begun | mask).all():
            raise ResetNeededError("The first reset must begin episodes in all rows: leave out the reset_mask.")
        chosen = self._simulator.check_options(options)
        for row, one in enumerate(seeds):
            if (one is not None or row not in self._generators) and mask[row]:
                self._generators[row], self._seeds[row] = seeding.np_random(one)
        self._begin(mask, **chosen)
        out = self._simulator.observe()
        self._record_rows(out, begun=mask, rows=mask)
        return observation(out), contexts(self.context, mask)

    def step(self, actions: npt.ArrayLike) -> tuple[Observation, FloatArray, BoolArray, BoolArray, Infos]:
        """One step of all arms; see the single environment for the returned values.

        Raises:
            ResetNeededError: A row has no episode, or an ended one that nobody resets.
            InvalidInputError: The actions are not finite or of a wrong shape. Nothing has changed then.
        """
        if not self._begun.all():
            raise ResetNeededError("step() needs episodes: call reset() first.")
        waiting = self._ended if self.autoreset_mode is AutoresetMode.NEXT_STEP else np.zeros_like(self._ended)
        if self._ended.any() and self.autoreset_mode is AutoresetMode.DISABLED:
            raise ResetNeededError(
                f"The episodes of rows {np.flatnonzero(self._ended).tolist()} have ended and autoreset is disabled: "
                "call reset(options={'reset_mask': …}) first."
            )
        stepping = ~waiting
        out = self._simulator.step(actions, stepping)
        rewards = -out.cost
        rewards[waiting] = 0.0
        made = self._simulator.steps_made
        over = stepping & ((made == self.scenario.steps) | (made - self._entered >= self._most_steps))
        lost = stepping & lost_rows(out, self.lost_distance)
        ended = over | lost
        same_step = self.autoreset_mode is AutoresetMode.SAME_STEP and bool(ended.any())
        infos: Infos = {}
        if same_step:
            infos["final_obs"], infos["_final_obs"] = last_observations(observation(out), ended), ended.copy()
            infos["final_info"], infos["_final_info"] = infos_of(out, ended, made, self.scenario), ended.copy()
        infos.update(infos_of(out, stepping & ~ended if same_step else stepping, made, self.scenario))
        beginning = ended if same_step else waiting
        if beginning.any():
            self._begin(beginning)
            self._simulator.observe(beginning, out)
            infos.update(contexts(self.context, beginning))
        self._record_rows(out, begun=beginning, rows=self._begun)
        self._ended = np.zeros_like(ended) if same_step else ended
        return observation(out), rewards, lost, over, infos

    def render(self) -> tuple[Any, ...] | None:
        """One picture a row, see :meth:`ikgym.RedundantIKEnv.render`; None without a `render_mode`.

        Raises:
            ResetNeededError: There are no episodes yet.
        """
        if self.render_mode is None:
            gym.logger.warn("render() draws nothing without a render_mode; give one to gym.make_vec().")
            return None
        if not self._begun.all():
            raise ResetNeededError("render() needs episodes: call reset() first.")
        return tuple(renderer.draw() for renderer in self._renderers)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each row: `scenario`, `np_random`, spaces and others.

        Raises:
            NoAttributeError: They have no such attribute.
        """
        shared = {
            "scenario": self.scenario,
            "observation_space": self.single_observation_space,
            "action_space": self.single_action_space,
            "metadata": RedundantIKEnv.metadata | {"render_fps": self.metadata["render_fps"]},
            "render_mode": self.render_mode,
        }
        specific = ("np_random", "np_random_seed")
        if name in specific:
            return getattr(self, name)  # type: ignore[no-any-return]  # one a row
        if name not in shared:
            raise NoAttributeError(
                f"The arms of a native vector environment have no {name!r}: they are reset, stepped and seen together. "
                f"Available: {', '.join((*shared, *specific))}. Environments one by one: gym.make_vec(…, "
                "vectorization_mode='sync')."
            )
        return (shared[name],) * self.num_envs

    def _generator(self, row: int) -> tuple[np.random.Generator, int]:
        """A row's generator and its seed, made from fresh entropy where there was none."""
        if row not in self._generators:
            self._generators[row], self._seeds[row] = seeding.np_random()
        return self._generators[row], self._seeds[row]

    def _begin(self, mask: BoolArray, **chosen: Any) -> None:
        self._simulator.reset(mask, self._generators, **chosen)
        self._entered[mask] = self._simulator.steps_made[mask]
        self._begun |= mask
        self._ended = self._ended & ~mask

    def _record_rows(self, out: Outcome, *, begun: BoolArray, rows: BoolArray) -> None:
        """Records the states of some rows for their pictures, if there are some; those that have begun start anew."""
        if self._renderers:
            for row in np.flatnonzero(rows).tolist():
                errors = float(out.position_error[row]), float(out.orientation_error[row])
                self._record(row, *errors, begins=bool(begun[row]))
