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
        grid: The horizon HL where it does not grow itself.
        episodes: Episodes an arm on which defaults are compared.
        poses: Poses whose inverse kinematics is measured.
        growth: Horizons HL along which growth is measured.
        joints: Numbers of joints n along which growth is measured.
        batches: Numbers of rows B along which growth is measured.
    """

    rounds: int = 15
    seconds: float = 0.05
    rows: tuple[int, ...] = (64, 1024, 16384)
    steps: int = 1000
    grids: tuple[int, ...] = (3, 10, 30, 100)
    states: int = 5
    solves: int = 7
    lead: int = 3
    grid: int = 30
    episodes: int = 24
    poses: int = 10_000
    growth: tuple[int, ...] = (10, 20, 50, 100, 200, 400)
    joints: tuple[int, ...] = (3, 5, 7, 10, 14)
    batches: tuple[int, ...] = (1, 4, 16, 64, 256, 1024)


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
    grid=3,
    episodes=1,
    poses=3,
    growth=(3, 4),
    joints=(3, 4),
    batches=(1, 2),
)
