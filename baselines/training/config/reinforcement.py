"""The configurations of PPO, SAC and TD3, which Stable-Baselines3 trains."""

from __future__ import annotations

import ast
import dataclasses
from typing import Annotated, Any, ClassVar

import tyro

from baselines.training.config.base import Config
from ikgym.exceptions import InvalidInputError
from ikgym.rl import Learning
from ikgym.validation import whole_number


@dataclasses.dataclass(frozen=True, kw_only=True)
class Reinforcement(Config):
    """The options that the algorithms of Stable-Baselines3 have in common."""

    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")] = "panda-random"
    """The scenario to train on. Random scenarios are trained on seeds of the split "train"."""
    n_envs: Annotated[int, tyro.conf.arg(metavar="N")] = 8
    """Number of arms stepped together, at most 10000."""
    total_timesteps: Annotated[int, tyro.conf.arg(metavar="N")] = 1_600_000
    """Steps of the environment in the whole training, those of all arms together."""
    settings: Annotated[tuple[str, ...], tyro.conf.arg(name="set", metavar="NAME=VALUE …")] = ()
    """Settings of the algorithm by Stable-Baselines3's names, such as learning_rate=1e-3 or
    policy_kwargs={'net_arch':[64,64]}. Those left out have the defaults of Stable-Baselines3, except buffer_size, which
    is not larger than the training. A number for action_noise is the standard deviation of normal noise."""
    learning: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE …")] = ()
    """Settings of the environment by the names of ikgym.rl.Learning, such as furthest=20.0 or preview=(1,10,40)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set("total_timesteps", whole_number("total_timesteps", self.total_timesteps, at_least=self.segments))
        values("set", self.settings)
        Learning().replace(**values("learning", self.learning))

    @property
    def algorithm_settings(self) -> dict[str, Any]:
        """The settings of the algorithm by name."""
        return values("set", self.settings)

    @property
    def learning_settings(self) -> dict[str, Any]:
        """The settings of the environment by name."""
        return values("learning", self.learning)


@dataclasses.dataclass(frozen=True, kw_only=True)
class PPO(Reinforcement):
    """Proximal policy optimisation (Schulman et al. 2017), by Stable-Baselines3 on ikgym.sb3.make_vec."""

    method: ClassVar[str] = "ppo"


@dataclasses.dataclass(frozen=True, kw_only=True)
class SAC(Reinforcement):
    """Soft actor-critic (Haarnoja et al. 2018), by Stable-Baselines3 on ikgym.sb3.make_vec."""

    method: ClassVar[str] = "sac"


@dataclasses.dataclass(frozen=True, kw_only=True)
class TD3(Reinforcement):
    """Twin delayed DDPG (Fujimoto et al. 2018), by Stable-Baselines3 on ikgym.sb3.make_vec."""

    method: ClassVar[str] = "td3"


def values(option: str, settings: tuple[str, ...]) -> dict[str, Any]:
    """Values by name, as Python literals or else as texts.

    Raises:
        InvalidInputError: A setting has another form than NAME=VALUE.
    """
    out: dict[str, Any] = {}
    for setting in settings:
        name, equals, text = str(setting).partition("=")
        if not name or not equals:
            raise InvalidInputError(f"{option}: expected NAME=VALUE, got {setting!r}.")
        try:
            out[name] = ast.literal_eval(text)
        except (ValueError, SyntaxError):
            out[name] = text
    return out
