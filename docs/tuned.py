"""The table `tuned`: solvers that know bodies, two parameters each, tuned with the same trials on validation scenes.

A scene is the first two seconds of a scenario, its obstacles moved by 8 mm and its path 20 % faster, where its bends
allow that (in `panda-shelf` they do not). The cost of a trial is the geometric mean of the total costs. The best
settings are a line of their own in `bodies`.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, cast

import numpy as np

import ikgym
from baselines import registry
from baselines.episodes import add_up, rollouts
from baselines.tuning import search
from baselines.tuning.ranges import Range
from docs.keeping import WORK, Line
from ikgym.obstacles import Box
from ikgym.scenarios import Scenario
from ikgym.trajectories.path_trajectory import PathTrajectory
from ikgym.trajectories.time_laws import Trapezoidal

TRIALS, SCENES = 8, ("panda-shelf", "panda-hand")
MOVED, FASTER, STEPS = (0.0, 0.0, 0.008), 1.2, 2000
_BARRIER = {
    "barrier_gain": {"low": 1.0, "high": 300.0, "log": True},
    "safe_displacement_gain": {"low": 1e-6, "high": 0.1, "log": True},
}
_REPULSION = {
    "influence": {"low": 0.03, "high": 0.5, "log": True},
    "repulsion": {"low": 0.1, "high": 100.0, "log": True},
}
#: Ranges of parameters, see :mod:`baselines.tuning.ranges`.
RANGES: Mapping[str, Mapping[str, Range]] = MappingProxyType(
    {
        "qp": _REPULSION,
        "null_space": _REPULSION,
        "mink": {
            "collision_gain": {"low": 1e-3, "high": 0.1, "log": True},
            "detection_distance": {"low": 0.02, "high": 0.3, "log": True},
        },
        "roboplan": _BARRIER,
        "pink": _BARRIER,
    }
)


@dataclasses.dataclass(frozen=True)
class BodiesSearch(search.Search):
    """The search for the settings of one solver on several scenes, whose episodes count from 0."""

    def costs(self, settings: Mapping[str, Any], seeds: Sequence[int]) -> list[float]:
        """See :meth:`Search.costs`."""
        chosen = [scene(SCENES[seed]) for seed in seeds]
        played = [rollouts(one, registry.make(self.spec, one, **settings), [0])[0] for one in chosen]
        return [float(add_up(episode.cost)) for episode in played]


def scene(name: str) -> Scenario:
    """The validation scene of a scenario."""
    scenario = ikgym.scenarios.get(name)
    trajectory = cast(PathTrajectory, scenario.trajectory)
    law = cast(Trapezoidal, trajectory.time_law)
    faster = dataclasses.replace(law, speed=FASTER * law.speed)
    obstacles = [
        dataclasses.replace(one, position=one.position + np.array(MOVED))
        for one in scenario.obstacles
        if isinstance(one, Box)
    ]
    return scenario.replace(
        name=f"{name}-validation",
        trajectory=dataclasses.replace(trajectory, time_law=faster),
        obstacles=obstacles,
        steps=STEPS,
    )


def measured() -> list[Line]:
    """The table."""
    seeds = tuple(range(len(SCENES)))
    wanted = [BodiesSearch(scene(SCENES[0]), name, ranges, seeds, 0) for name, ranges in RANGES.items()]
    folder = pathlib.Path(WORK / "tuned-bodies")
    folder.mkdir(parents=True, exist_ok=True)
    found = search.run(folder, wanted, TRIALS, workers=1, resume=True, overwrite=False)
    return [
        {"policy": one["spec"], "trials": TRIALS, "default": one["default"], "tuned": one["tuned"]}
        | {"settings": ",".join(f"{name}={value:.3g}" for name, value in one["settings"].items())}
        for one in found
    ]
