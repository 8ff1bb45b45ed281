"""Receding horizon that plans three seconds ahead in real time."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from baselines.solvers.receding_horizon.newton.grid import evenly_growing_offsets
from baselines.solvers.receding_horizon.rhc import RecedingHorizon

# By how many steps each block of the plan is longer than the previous one, and the longest.
GROWTH, LONGEST = 2.0, 100.0
# Values of parameters that are None: for arms without limits, and with limits.
FREE = {"horizon": 3001, "iterations": 1, "starts": 23, "restart_steps": 20, "start_steps": 10}
LIMITED = {"iterations": 3, "starts": 1, "restart_steps": 0, "start_steps": 0}
# Of arms with limits and among bodies: how far ahead in [s].
AHEAD, AHEAD_AMONG_BODIES = 1.5, 3.0
# Likewise the control period in [s] for which blocks have the lengths above.
PERIOD = 1e-3


@dataclasses.dataclass(frozen=True, eq=False)
class RecedingHorizonForesight(RecedingHorizon):
    """A preset of :class:`rhc.RecedingHorizon` for control periods of 1 ms, chosen on validation episodes.

    **Arms without limits.** One Newton step a period for the plan, and one for a restart candidate, which finds the way
    out of local minima that a single plan would keep. The plan looks 3,000 steps ahead: motions of the arm in
    its null space decide the cost of motions seconds later. Its 56 blocks grow evenly, and reach that far without
    skipping an oscillation. Blocks that grow geometrically do skip some: of 57 knots in 1,500 steps, half lie in the
    first tenth, and the last block has 127 steps. The first plan takes two periods, of four and six Newton steps.
    Each of the 22 after them tries another guess with ten, which is longer than a control period of 1 ms; of 3,000
    periods these are 0.7 %. A period behind one that ended beyond the velocity limits has four.

    **Arms with limits** of position, velocity or acceleration. Plans are made by the interior point method, whose
    Newton steps take longer and go further: three for the plan alone are worth more than candidates. Limits turn up
    in the far end of a plan that so few steps cannot settle, so that it looks 1.5 s ahead, at whatever control period;
    the lengths of its blocks are those of 1 ms in time, too, since the path turns as quickly for a slow controller.

    **Among bodies** that may not touch, plans are made in the same way, for arms without limits, too, but look 3 s
    ahead. On which side a body is passed is decided long before: in `panda-hand` a plan of 1.5 s has moved the null
    space to the wrong side when the elbow comes into sight, and from there no better plan is near.

    Args:
        horizon: As in ``rhc``. None for 3,001; 1.5 s for arms with limits, 3 s among bodies.
        iterations: As in ``rhc``, where None is the optimum. Here it is 1, and 3 for arms with limits.
        move_blocks: As in ``rhc``, but None for blocks that are each 2 steps longer than the one before, up to 100; for
            arms with limits each 2 ms longer, up to 0.1 s.
        starts: As in ``rhc``. None for 23, and 1 for arms with limits.
        restart_steps: As in ``rhc``. None for 20, and 0 for arms with limits.
        start_steps: As in ``rhc``. None for 10, and 0 for arms with limits.
    """

    horizon: int | None = None  # type: ignore[assignment]
    iterations: int | None = None
    stop_at_end: bool = True
    starts: int | None = None  # type: ignore[assignment]
    restart_steps: int | None = None  # type: ignore[assignment]
    start_steps: int | None = None  # type: ignore[assignment]
    recovery_steps: int = 4

    name: ClassVar[str] = "rhc_foresight"

    def __post_init__(self) -> None:
        """Settles the parameters that depend on the arm."""
        seconds = AHEAD_AMONG_BODIES if self.among_bodies else AHEAD
        ahead = {"horizon": 1 + max(1, round(seconds / self.problem.dt))}
        usual = LIMITED | ahead if self.interior_point else FREE
        self._settle(**{name: value for name, value in usual.items() if getattr(self, name) is None})
        super().__post_init__()

    @property
    def interior_point(self) -> bool:
        """Whether plans are made by the interior point method: for arms with limits of any kind, or with bodies."""
        return self.problem.model.limited or super().interior_point

    def _knots(self) -> npt.NDArray[np.int64]:
        """Steps from now to the knots. Shape (K,)."""
        if self.move_blocks is None:
            share = PERIOD / self.problem.dt if self.interior_point else 1.0
            return evenly_growing_offsets(self.horizon - 1, share * GROWTH, max(1.0, share * LONGEST))  # type: ignore[operator]
        return super()._knots()
