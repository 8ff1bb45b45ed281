"""What is played: the test set, and scenarios that no solver was tuned on."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from baselines.evaluation import test_sets
from ikgym import scenarios
from ikgym.exceptions import UnknownNameError
from ikgym.scenarios import Scenario
from ikgym.trajectories import RandomSinusoid

#: The test set that scores are published on.
MAIN = "varga7-random"
#: Episodes of a changed scenario: the first of the test split.
EPISODES = 32


def larger() -> Scenario:
    """Amplitudes × 1.2."""
    trajectory = _random()
    return _changed("varga7-random-amplitude", trajectory.replace(amplitude=1.2 * trajectory.amplitude))


def faster() -> Scenario:
    """Frequencies up to 4 rad/s instead of 3 rad/s."""
    return _changed("varga7-random-frequency", _random().replace(frequency=(1.0, 4.0)))


#: Scenarios beside the main one, and what is different in them.
CHANGED: Mapping[str, tuple[Callable[[], Scenario], str]] = {
    "varga7-random-amplitude": (larger, "amplitudes × 1.2"),
    "varga7-random-frequency": (faster, "frequencies of 1 to 4 rad/s instead of 1 to 3 rad/s"),
    "varga7-fast": (lambda: scenarios.get("varga7-fast"), "the fast trajectory of Varga 2021, 3,000 steps"),
}


def names() -> tuple[str, ...]:
    """The main set, then the changed scenarios."""
    return MAIN, *CHANGED


def get(name: str) -> Scenario:
    """A scenario that is played.

    Raises:
        UnknownNameError: There is none of that name.
        InvalidInputError: The main set has drifted.
    """
    if name == MAIN:
        return test_sets.get(name).scenario
    if name not in CHANGED:
        raise UnknownNameError("scenario of the leaderboard", name, names())
    return CHANGED[name][0]()


def _random() -> RandomSinusoid:
    trajectory = scenarios.get(MAIN).trajectory
    assert isinstance(trajectory, RandomSinusoid)  # the catalogue says so
    return trajectory


def _changed(name: str, trajectory: RandomSinusoid) -> Scenario:
    return scenarios.get(MAIN).replace(name=name, trajectory=trajectory)
