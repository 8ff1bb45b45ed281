"""Whoever is evaluated, before it is made for a scenario."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Mapping
from typing import Any

from baselines.episodes import Policy, Seeds
from ikgym.exceptions import InvalidInputError
from ikgym.preview import offsets
from ikgym.scenarios import Preview, Scenario


@dataclasses.dataclass(frozen=True, eq=False)
class Entrant(abc.ABC):
    """Who is evaluated, before it is made for a scenario.

    Args:
        name: What rows call it.
    """

    name: str

    #: Whether rows tell it from another one of its name, so that results of both cannot be taken for each other.
    told_apart = True

    def for_episode(self, scenario: Scenario, draw: Seeds) -> dict[str, Any]:
        """The parameters that it is made with for one episode."""
        del scenario, draw
        return {}

    def made_for_episodes(self, scenario: Scenario) -> bool:
        """Whether it is made anew for each episode, as references are that know which one they play."""
        return self.for_episode(scenario, Seeds(0)) != self.for_episode(scenario, Seeds(1))

    @abc.abstractmethod
    def make(self, scenario: Scenario, given: Mapping[str, Any], preview: Preview | None) -> Policy:
        """Who plays, made with what :meth:`for_episode` gave.

        Raises:
            IkgymError: It cannot be made.
        """

    @abc.abstractmethod
    def parameters(self, scenario: Scenario, player: Policy) -> dict[str, Any]:
        """The parameters that rows have."""

    @abc.abstractmethod
    def unsuited(self, scenario: Scenario, draw: Seeds, preview: Preview | None) -> str | None:
        """Why it does not suit a scenario; None where it does."""

    @abc.abstractmethod
    def shown(self, player: Policy, preview: Preview | None) -> Preview:
        """The steps ahead that it is shown.

        Raises:
            InvalidInputError: They are not those that it needs.
        """


def covering(player: Policy, preview: Preview | None) -> Preview:
    """What a solver is shown: what it asks for, or something that has it in the place where it looks for it.

    Raises:
        InvalidInputError: Steps ahead that are no whole range are not those that it asks for.
    """
    if preview is None or isinstance(preview, int):
        return player.preview if preview is None else preview
    needed, shown = offsets(player.preview), offsets(preview)
    if shown[: len(needed)] != needed or not (isinstance(player.preview, int) or shown == needed):
        raise InvalidInputError(f"{player.name} needs to be shown the steps {needed} ahead, got preview={preview}.")
    return preview
