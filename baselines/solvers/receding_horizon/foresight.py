"""Receding horizon that plans a second and a half ahead in real time."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from baselines.solvers.receding_horizon.newton.grid import offsets
from baselines.solvers.receding_horizon.rhc import RecedingHorizon
from ikgym.validation import whole_number

# The spacing of knots for any horizon: so many in so many steps.
KNOTS, STEPS = 64, 3000


@dataclasses.dataclass(frozen=True, eq=False)
class RecedingHorizonForesight(RecedingHorizon):
    """A preset of :class:`rhc.RecedingHorizon` for control periods of 1 ms, chosen on validation episodes.

    One Newton step a period for the plan, and one for a restart candidate, which finds the way out of local minima that
    a single plan would keep. 57 knots in 1,500 steps: fewer cost more between the knots; a shorter horizon leads into
    costly local minima that nothing repairs later, and one of 3,000 steps does so in `varga7-fast`. The first 28
    periods, less than a hundredth of 3,000, try an initial guess each with ten Newton steps; a period behind one that
    ended beyond the velocity limits has four.

    Args:
        move_blocks: As in ``rhc``, but None for as many knots as 64 in 3,000 steps have up to the horizon.
    """

    horizon: int = 1501
    iterations: int | None = 1
    stop_at_end: bool = True
    starts: int = 28
    restart_steps: int = 20
    start_steps: int = 10
    recovery_steps: int = 4

    name: ClassVar[str] = "rhc_foresight"

    def __post_init__(self) -> None:
        """Fills in the number of knots."""
        if self.move_blocks is None:
            steps = whole_number("horizon", self.horizon, at_least=2) - 1
            knots = int(np.searchsorted(offsets(STEPS, KNOTS), steps)) + 1
            object.__setattr__(self, "move_blocks", min(knots, KNOTS))
        super().__post_init__()
