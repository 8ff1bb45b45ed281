"""Receding horizon that plans a second and a half ahead in real time."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

from baselines.solvers.receding_horizon.rhc import RecedingHorizon


@dataclasses.dataclass(frozen=True, eq=False)
class RecedingHorizonForesight(RecedingHorizon):
    """A preset of :class:`rhc.RecedingHorizon` for control periods of 1 ms, chosen on validation episodes.

    One Newton step a period for the plan, and one for a restart candidate, which finds the way out of local minima that
    a single plan would keep. 48 knots in 1,500 steps: fewer cost more between the knots, a shorter horizon leads into
    costly local minima that nothing repairs later.
    """

    horizon: int = 1501
    iterations: int | None = 1
    move_blocks: int | None = 48
    stop_at_end: bool = True
    starts: int = 64
    restart_steps: int = 20

    name: ClassVar[str] = "rhc_foresight"
