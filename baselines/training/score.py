"""How an agent did on the validation split."""

from __future__ import annotations

import dataclasses
from typing import Any


@dataclasses.dataclass(frozen=True)
class Score:
    """How an agent did on the validation split.

    Args:
        episodes: How many were played.
        cost: Geometric mean of their costs.
        cost_ratio: Geometric mean of their costs over those of the reference; None where there is none.
        worst: Largest of these ratios; of the costs where there is no reference.
        lost: Share of the episodes in which the arm lost track, see :func:`baselines.evaluation.metrics.lost`.
        position_error_max_mm: Mean over the episodes of their largest position error, in [mm]; None in runs of before
            it was measured.
        orientation_error_max_mrad: The same of the orientation, in [mrad]; None where the task has none.
    """

    episodes: int
    cost: float
    cost_ratio: float | None
    worst: float
    lost: float
    position_error_max_mm: float | None = None
    orientation_error_max_mrad: float | None = None

    def to_json(self) -> dict[str, Any]:
        """The fields by name."""
        return dataclasses.asdict(self)
