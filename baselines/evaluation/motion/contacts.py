"""How close bodies came to each other and to obstacles in an episode."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.recording import Episode, add_up
from ikgym.scenarios import Scenario
from ikgym.scenarios.contacts import pair_names


def contacts(scenario: Scenario, episode: Episode) -> dict[str, Any]:
    """The columns of a row that state it, and its cost, see :class:`baselines.evaluation.metrics.Row`.

    None where nothing can meet.
    """
    if episode.clearance is None or episode.pair is None or episode.stopped is None or episode.pair[0, 0] < 0:
        return {}
    stops = np.flatnonzero(episode.stopped)
    until = episode.clearance[: stops[0] + 1] if len(stops) else episode.clearance
    step = int(stops[0] if len(stops) else until.argmin())
    return {
        "clearance_min": float(until.min()),
        "closest_pair": list(pair_names(scenario, episode.pair[step].astype(np.int64).tolist())),
        "closest_step": step + 1,
        "stopped": step + 1 if len(stops) else None,
        "proximity_cost": None if episode.proximity_cost is None else float(add_up(episode.proximity_cost)),
    }
