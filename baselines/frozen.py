"""Evaluation sets that stay as they are, so that results of different days can be compared.

A set is a scenario and its seeds. The digest of both, and of the version of the cost, is written down here: a set that
has drifted is refused, and results of different sets are never put together.
"""

from __future__ import annotations

import dataclasses

from baselines.content import set_hash
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.scenarios import Scenario


@dataclasses.dataclass(frozen=True)
class FrozenSet:
    """Episodes that are never changed; other episodes are another set.

    Args:
        name: Of the set, and of its scenario, which is played to its end.
        episodes: How many: the first seeds of the split.
        digest: What :func:`baselines.content.set_hash` gave when the set was made.
        split: Where the seeds come from, see :data:`ikgym.scenarios.SPLITS`.
    """

    name: str
    episodes: int
    digest: str
    split: str = "test"

    @property
    def scenario(self) -> Scenario:
        """What is played."""
        return scenarios.get(self.name)

    @property
    def seeds(self) -> tuple[int, ...]:
        """The reset seeds."""
        return scenarios.seeds(self.split, self.episodes)


#: All frozen sets.
SETS = {
    one.name: one
    for one in (
        FrozenSet("varga7-random", episodes=64, digest="f18d6765c034"),
        FrozenSet("varga7-random-long", episodes=16, digest="f6956633fa43"),
    )
}


def names() -> tuple[str, ...]:
    """The names of all frozen sets."""
    return tuple(SETS)


def get(name: str) -> FrozenSet:
    """The frozen set of a name.

    Raises:
        UnknownNameError: There is no such set.
        InvalidInputError: Its scenario, its seeds or the cost are no longer what they were.
    """
    if name not in SETS:
        raise UnknownNameError("frozen set", name, SETS)
    frozen = SETS[name]
    if (now := set_hash(frozen.scenario, frozen.seeds)) != frozen.digest:
        raise InvalidInputError(
            f"The frozen set {name!r} has drifted: its digest is {now}, expected {frozen.digest}. Its scenario, its "
            "seeds or the cost have changed; what is meant to differ needs a new set with a name of its own."
        )
    return frozen
