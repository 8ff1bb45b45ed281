"""Episodes that figures and claims share, each played once."""

from __future__ import annotations

from typing import Any

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from baselines.episodes import Episode, rollout
from baselines.files import canonical, jsonable
from baselines.fingerprints import episode_hash
from baselines.registry import make
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray


class Runs:
    """Plays episodes on demand, and keeps them.

    Args:
        steps: Most steps of an episode, for trials; those of the scenarios if left out.
        progress: Whether to show a bar on stderr while an episode is played.
    """

    def __init__(self, steps: int | None = None, *, progress: bool = False) -> None:
        self.steps, self._progress = steps, progress
        self._episodes: dict[tuple[str, str, str], Episode] = {}

    def scenario(self, name: str | Scenario) -> Scenario:
        """A scenario, shortened if the run is a trial."""
        whole = scenarios.find(name)
        return whole if self.steps is None else whole.replace(steps=min(self.steps, whole.steps))

    def play(self, scenario: str | Scenario, policy: str, /, **parameters: Any) -> Episode:
        """The episode of a policy in a fixed scenario, from seed 0; the same object at every call."""
        what = self.scenario(scenario)
        key = episode_hash(what, 0), policy, canonical(jsonable(parameters))
        if key not in self._episodes:
            bar = tqdm(
                total=what.steps,
                desc=f"{what.name} · {policy}",
                unit="step",
                unit_scale=True,
                leave=False,
                disable=not self._progress,
            )
            # As in an evaluation: one thread, so that times are comparable.
            with bar, threadpool_limits(limits=1):
                self._episodes[key] = rollout(what, make(policy, what, **parameters), 0, tick=bar.update)
        return self._episodes[key]


def times(scenario: Scenario) -> FloatArray:
    """Times at the end of each step, in [s]. Shape (steps,)."""
    return scenario.times(scenario.steps + 1)[1:]


def nominal_joints(scenario: Scenario) -> FloatArray:
    """The joint coordinates that generate the nominal path, in [rad] or [m]. Shape (steps, n).

    Raises:
        InvalidInputError: The scenario has no such path.
    """
    path = scenario.nominal_joint_path()
    if path is None:
        raise InvalidInputError(f"scenario {scenario.name!r} has no joint path to compare with.")
    return path[1:]
