"""Receding horizon that plans three seconds ahead in real time."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from baselines.solvers.receding_horizon.newton.grid import evenly_growing_offsets
from baselines.solvers.receding_horizon.rhc import RecedingHorizon

# Each block of the plan is so many steps longer than the one before, up to a length.
GROWTH, LONGEST = 1.5, 100.0


@dataclasses.dataclass(frozen=True, eq=False)
class RecedingHorizonForesight(RecedingHorizon):
    """A preset of :class:`rhc.RecedingHorizon` for control periods of 1 ms, chosen on validation episodes.

    One Newton step a period for the plan, and one for a restart candidate, which finds the way out of local minima that
    a single plan would keep. The first 28 periods, less than a hundredth of 3,000, try an initial guess each with ten
    Newton steps; a period behind one that ended beyond the velocity limits has four.

    3,000 steps ahead in 65 knots: what a redundant arm does with its null space now decides what motions seconds later
    cost, and with 1,500 steps a few in a hundred long episodes cost up to three times as much. Blocks that grow evenly
    reach that far without skipping an oscillation. Those that grow geometrically do: of 57 knots in 1,500 steps, half
    lie in the first tenth, and the last block has 127 steps.

    Args:
        move_blocks: As in ``rhc``, but None for blocks that are each 1.5 steps longer than the one before, up to 100.
    """

    horizon: int = 3001
    iterations: int | None = 1
    stop_at_end: bool = True
    starts: int = 28
    restart_steps: int = 20
    start_steps: int = 10
    recovery_steps: int = 4

    name: ClassVar[str] = "rhc_foresight"

    def _knots(self) -> npt.NDArray[np.int64]:
        """Steps from now to the knots. Shape (K,)."""
        if self.move_blocks is None:
            return evenly_growing_offsets(self.horizon - 1, GROWTH, LONGEST)
        return super()._knots()
