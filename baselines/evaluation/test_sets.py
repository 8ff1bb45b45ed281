"""Test sets: fixed scenarios and seeds, so that results of different days can be compared.

The digest of scenario, seeds and version of the cost is stated here. A set whose digest has changed is refused, and
results of different sets are never combined.
"""

from __future__ import annotations

import dataclasses

from baselines.fingerprints import set_hash
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.scenarios import Scenario


@dataclasses.dataclass(frozen=True)
class TestSet:
    """A fixed set of test episodes."""

    name: str  # the name of the set and of its scenario
    episodes: int  # the number of episodes: the first seeds of the split
    digest: str  # the value of :func:`baselines.fingerprints.set_hash` when the set was defined
    split: str = "test"  # the split of the seeds, see :data:`ikgym.scenarios.SPLITS`
    noise_seeds: int = 1  # repetitions of each episode with other noise in sensors and drives
    # episodes that one arm plays in a row: seed s has the arm seed s // sequence, and the policy keeps its state.
    # 1 if every episode has another arm
    sequence: int = 1

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return scenarios.get(self.name)

    @property
    def seeds(self) -> tuple[int, ...]:
        """The reset seeds."""
        return scenarios.seeds(self.split, self.episodes)

    def arm_seed(self, seed: int) -> int | None:
        """Which arm moves in the episode of a seed; None where the seed itself says so."""
        return seed // self.sequence if self.sequence > 1 else None


#: All test sets.
SETS = {
    one.name: one
    for one in (
        TestSet("varga7-pose-random", episodes=256, digest="44d453ac128b"),
        TestSet("varga7-pose-random-long", episodes=32, digest="fe2dfbb641c8"),
        TestSet("varga7-random", episodes=64, digest="f18d6765c034"),
        TestSet("varga7-random-long", episodes=16, digest="f6956633fa43"),
        # Fewer episodes than in the first set: each needs a search for its best known cost.
        TestSet("panda-random", episodes=128, digest="f4492864d6be"),
        TestSet("iiwa14-random", episodes=128, digest="4b2efa43deaa"),
        # Imperfect plants. Three noise seeds of 64 episodes are 576,000 steps, and every episode needs a best known
        # cost on its arm.
        TestSet("panda-ideal", episodes=64, digest="48bde4a871be"),
        TestSet("panda-measured", episodes=64, digest="c6fd6151ddef"),
        TestSet("panda-camera", episodes=64, digest="fef44af732ba", noise_seeds=3),
        TestSet("panda-camera-slow", episodes=64, digest="6d89d0594207", noise_seeds=3),
        # 13 arms with five episodes each.
        TestSet("panda-same-arm", episodes=65, digest="bc8dd757d74b", noise_seeds=3, sequence=5),
        TestSet("panda-payload", episodes=64, digest="1dcbd797b41b"),
        TestSet("panda-bus", episodes=64, digest="700b8d28bf95"),
        TestSet("panda-clutter-random", episodes=128, digest="068a39191fc3"),
        TestSet("panda-field", episodes=64, digest="3f19a2c4b072", noise_seeds=3),
    )
}


def sequence(name: str) -> int:
    """Episodes that one arm plays in a row in a scenario, as its test set says; 1 if it is no test set."""
    return SETS[name].sequence if name in SETS else 1


def names() -> tuple[str, ...]:
    """The names of all test sets."""
    return tuple(SETS)


def get(name: str) -> TestSet:
    """The test set of a name; refused if its scenario, its seeds or the cost have changed."""
    if name not in SETS:
        raise UnknownNameError("test set", name, SETS)
    found = SETS[name]
    if (now := set_hash(found.scenario, found.seeds)) != found.digest:
        raise InvalidInputError(
            f"The test set {name!r} has changed: its digest is {now}, expected {found.digest}. Its scenario, its seeds "
            "or the cost are no longer the same; define a new set with another name."
        )
    return found
