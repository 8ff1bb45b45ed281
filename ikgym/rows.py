"""One row of a vector environment, with the attributes of a single environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ikgym.env import RedundantIKEnv
from ikgym.exceptions import NoAttributeError

#: Attributes that every row has, from the vector environment and the number of the row.
_SHARED: dict[str, Callable[[Any, int], Any]] = {
    "scenario": lambda envs, _: envs.scenario,
    "observation_space": lambda envs, _: envs.single_observation_space,
    "action_space": lambda envs, _: envs.single_action_space,
    "metadata": lambda *_: RedundantIKEnv.metadata,
    "render_mode": lambda envs, _: envs.render_mode,
    "np_random": lambda envs, row: envs.generator(row)[0],
    "np_random_seed": lambda envs, row: envs.generator(row)[1],
}
_OWN = ("_envs", "_index")


class ArmRow:
    """Attributes of one of N arms: the shared ones, its generator, and those set by users.

    Args:
        envs: The vector environment.
        index: Number of the row.
    """

    def __init__(self, envs: Any, index: int) -> None:
        self.__dict__.update(_envs=envs, _index=index)

    def __getattr__(self, name: str) -> Any:
        if name in _SHARED:
            return _SHARED[name](self._envs, self._index)
        if name.startswith("__"):  # what copy and pickle ask for
            raise AttributeError(name)
        given = (one for one in self.__dict__ if one not in _OWN)
        raise NoAttributeError(
            f"The arms of a native vector environment have no {name!r}: they are reset, stepped and seen together. "
            f"Available: {', '.join((*_SHARED, *given))}. Environments one by one: gym.make_vec(…, "
            "vectorization_mode='sync')."
        )

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _SHARED or name in _OWN:
            raise NoAttributeError(f"{name!r} of one arm cannot be set: make another environment.")
        self.__dict__[name] = value
