"""What the pages play: the test sets, single scenarios, and scenarios that no solver was tuned on."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping

from baselines.evaluation import test_sets
from ikgym import scenarios
from ikgym.scenarios import Scenario
from ikgym.trajectories import RandomSinusoid

#: The test set that scores are published on, the long one beside it, and the one in the papers' own skew coordinates.
MAIN, LONG, SKEW = "varga7-pose-random", "varga7-pose-random-long", "varga7-random"
#: The arms of the page of rivals.
RIVAL_ARMS = ("panda", "iiwa14", "tiago")
#: Episodes of a random scenario that is no test set: the first of the test split.
EPISODES = 32


def larger(base: str) -> Scenario:
    """Amplitudes × 1.2."""
    trajectory = _random(base)
    return _changed(f"{base}-amplitude", base, trajectory.replace(amplitude=1.2 * trajectory.amplitude))


def faster(base: str) -> Scenario:
    """Frequencies up to 4 rad/s instead of 3 rad/s."""
    return _changed(f"{base}-frequency", base, _random(base).replace(frequency=(1.0, 4.0)))


#: What a leaderboard plays beside its main test set, and what is different there.
CHANGED: Mapping[str, tuple[Callable[[], Scenario], str]] = {
    "varga7-fast": (lambda: scenarios.get("varga7-fast"), "the fast trajectory of Varga 2021, 3,000 steps")
} | {
    f"{base}-{name}": (functools.partial(maker, base), what)
    for base in (MAIN, SKEW)
    for name, maker, what in (
        ("amplitude", larger, "amplitudes × 1.2"),
        ("frequency", faster, "frequencies of 1 to 4 rad/s instead of 1 to 3 rad/s"),
    )
}


def leaderboard(main: str = MAIN) -> tuple[str, ...]:
    """What a leaderboard plays: its main test set, then the changed scenarios."""
    return main, f"{main}-amplitude", f"{main}-frequency", "varga7-fast"


def cost_time() -> tuple[str, ...]:
    """What the cost–time page plays: the test sets of whole poses, then the scenarios with one episode.

    Those that hold their points are left out: there the task is to iterate. So are the arms with limits, which have no
    best known costs yet.
    """
    every = (one for one in map(scenarios.get, scenarios.names()) if not one.arm.limited)
    return MAIN, LONG, *(s.name for s in every if not s.random and s.counted()[1:].all())


def foresight() -> tuple[str, ...]:
    """What the foresight page plays."""
    return MAIN, LONG


def rivals() -> tuple[str, ...]:
    """What the page of rivals plays: the paths of real arms that are the same at every reset."""
    every = map(scenarios.get, scenarios.names())
    return tuple(s.name for s in every if s.name.startswith(tuple(f"{arm}-" for arm in RIVAL_ARMS)) and not s.random)


def get(name: str) -> Scenario:
    """The scenario of a test set, a changed scenario, or a registered one.

    Raises:
        UnknownNameError: There is none of that name.
        InvalidInputError: The test set has drifted.
    """
    if name in test_sets.names():
        return test_sets.get(name).scenario
    return CHANGED[name][0]() if name in CHANGED else scenarios.get(name)


def _random(base: str) -> RandomSinusoid:
    trajectory = scenarios.get(base).trajectory
    assert isinstance(trajectory, RandomSinusoid)  # the catalogue says so
    return trajectory


def _changed(name: str, base: str, trajectory: RandomSinusoid) -> Scenario:
    return scenarios.get(base).replace(name=name, trajectory=trajectory)
