"""How much is measured: the sizes of the tables, and how often everything has its turn."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class Effort:
    """The size of a run.

    Args:
        rounds: Turns of each call that is compared.
        seconds: About how long a turn lasts, at least one call, in [s].
        rows: Sizes N of vector environments.
        steps: Steps along which `predict` is timed.
        grids: Horizons HL, in grid points with the present one, at which solvers are compared.
        states: States at which they are compared.
        solves: Turns of each solver at each of these states.
        lead: Steps before each of these states, in which solvers warm up, outside the clock.
        poses: Poses whose inverse kinematics is measured.
    """

    rounds: int = 15
    seconds: float = 0.05
    rows: tuple[int, ...] = (64, 1024, 16384)
    steps: int = 1000
    grids: tuple[int, ...] = (3, 10, 30, 100)
    states: int = 5
    solves: int = 7
    lead: int = 3
    poses: int = 10_000


FULL = Effort()
#: Shows that everything runs; its figures mean nothing.
QUICK = Effort(
    rounds=1,
    seconds=0.0,
    rows=(3,),
    steps=3,
    grids=(3,),
    states=1,
    solves=1,
    lead=1,
    poses=3,
)
