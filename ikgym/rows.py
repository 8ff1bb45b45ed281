"""One row of a vector environment, with the attributes of a single environment."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np

from ikgym.env import RedundantIKEnv
from ikgym.exceptions import NoAttributeError
from ikgym.scenarios import Scenario


class ArmRow:
    """Attributes of one of N arms: the shared ones, its generator, and those set by users.

    Args:
        envs: The vector environment.
        index: Number of the row.
    """

    metadata: ClassVar[dict[str, Any]] = RedundantIKEnv.metadata
    render_mode: ClassVar[None] = None

    def __init__(self, envs: Any, index: int) -> None:
        self.__dict__.update(_envs=envs, _index=index)

    @property
    def scenario(self) -> Scenario:
        """The tracking problem."""
        scenario: Scenario = self._envs.scenario
        return scenario

    @property
    def observation_space(self) -> gym.Space[Any]:
        """Of one arm."""
        space: gym.Space[Any] = self._envs.single_observation_space
        return space

    @property
    def action_space(self) -> gym.Space[Any]:
        """Of one arm."""
        space: gym.Space[Any] = self._envs.single_action_space
        return space

    @property
    def np_random(self) -> np.random.Generator:
        """The row's generator."""
        generator: np.random.Generator = self._envs.generator(self._index)[0]
        return generator

    @property
    def np_random_seed(self) -> int:
        """The seed of the row's generator."""
        seed: int = self._envs.generator(self._index)[1]
        return seed

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # what copy and pickle ask for
            raise AttributeError(name)
        raise NoAttributeError(
            f"The arms of a native vector environment have no {name!r}: they are reset, stepped and seen together. "
            f"Available: {', '.join((*_SHARED, *self._given()))}. Environments one by one: gym.make_vec(…, "
            "vectorization_mode='sync')."
        )

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _SHARED or name in _OWN:
            raise NoAttributeError(f"{name!r} of one arm cannot be set: make another environment.")
        self.__dict__[name] = value

    def _given(self) -> list[str]:
        return [name for name in self.__dict__ if name not in _OWN]


_SHARED = ("scenario", "observation_space", "action_space", "metadata", "render_mode", "np_random", "np_random_seed")
_OWN = ("_envs", "_index")
