"""What the pages play: the test sets, single scenarios, and scenarios that no solver was tuned on."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from baselines.evaluation import test_sets
from ikgym import scenarios
from ikgym.scenarios import Scenario
from ikgym.trajectories import RandomSinusoid

#: The test set that scores are published on.
MAIN = "varga7-random"
#: Episodes of a random scenario that is no test set: the first of the test split.
EPISODES = 32


def larger() -> Scenario:
    """Amplitudes × 1.2."""
    trajectory = _random()
    return _changed("varga7-random-amplitude", trajectory.replace(amplitude=1.2 * trajectory.amplitude))


def faster() -> Scenario:
    """Frequencies up to 4 rad/s instead of 3 rad/s."""
    return _changed("varga7-random-frequency", _random().replace(frequency=(1.0, 4.0)))


#: The scenarios of the leaderboard beside the main test set, and what is different in them.
CHANGED: Mapping[str, tuple[Callable[[], Scenario], str]] = {
    "varga7-random-amplitude": (larger, "amplitudes × 1.2"),
    "varga7-random-frequency": (faster, "frequencies of 1 to 4 rad/s instead of 1 to 3 rad/s"),
    "varga7-fast": (lambda: scenarios.get("varga7-fast"), "the fast trajectory of Varga 2021, 3,000 steps"),
}


def leaderboard() -> tuple[str, ...]:
    """What the leaderboard plays: the main test set, then the changed scenarios."""
    return MAIN, *CHANGED


def cost_time() -> tuple[str, ...]:
    """What the cost–time page plays: the test sets, then the scenarios with one episode.

    Those that hold their points are left out: there the task is to iterate.
    """
    every = map(scenarios.get, scenarios.names())
    return *test_sets.names(), *(s.name for s in every if not s.random and s.counted()[1:].all())


def get(name: str) -> Scenario:
    """The scenario of a test set, a changed scenario, or a registered one.

    Raises:
        UnknownNameError: There is none of that name.
        InvalidInputError: The test set has drifted.
    """
    if name in test_sets.names():
        return test_sets.get(name).scenario
    return CHANGED[name][0]() if name in CHANGED else scenarios.get(name)


def _random() -> RandomSinusoid:
    trajectory = scenarios.get(MAIN).trajectory
    assert isinstance(trajectory, RandomSinusoid)  # the catalogue says so
    return trajectory


def _changed(name: str, trajectory: RandomSinusoid) -> Scenario:
    return scenarios.get(MAIN).replace(name=name, trajectory=trajectory)
