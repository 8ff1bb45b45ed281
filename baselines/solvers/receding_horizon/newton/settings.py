"""Settings of a receding horizon for its kernels, in two blocks of numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.jit import expanded

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class PlanSettings(NamedTuple):
    """The parameters of :class:`baselines.solvers.receding_horizon.rhc.RecedingHorizon`, as its kernels see them.

    Attributes, where they are not the parameters themselves:
        at: Steps from now to the knots. Shape (K,).
        iterations: Newton steps in one period; -1 to the optimum.
        joint_weights: Factors of the velocity costs of the joints. Shape (n,).
        change_limit: Largest changes of velocity in one step, see :class:`workspace.PathProblem`. Shape (n or 0,).
    """

    at: Integers
    terminal_weight: float
    stop_at_end: bool
    iterations: int
    tolerance: float
    starts: int
    restart_steps: int
    seed: int
    start_steps: int
    recovery_steps: int
    rate_weight: float
    joint_weights: Floats
    change_limit: Floats


def plain_settings(settings: PlanSettings) -> tuple[Floats, Integers]:
    """The numbers and the whole numbers of settings, each as one read-only block, for :func:`settings_of`.

    A `predict` takes arguments apart at 0.1 µs each, which for all of them one by one is longer than a Newton step.
    """
    s = settings
    numbers = np.array([s.terminal_weight, s.tolerance, s.rate_weight, *s.joint_weights, *s.change_limit])
    steps = s.iterations, s.starts, s.restart_steps, s.seed, s.start_steps, s.recovery_steps
    integers = np.array([s.stop_at_end, *steps, *s.at], dtype=np.int64)
    for block in (numbers, integers):
        block.flags.writeable = False
    return numbers, integers


@expanded
def settings_of(numbers, integers, n):
    """The :class:`PlanSettings` that :func:`plain_settings` took apart, for n joints."""
    return PlanSettings(
        integers[7:],
        numbers[0],
        integers[0] != 0,
        integers[1],
        numbers[1],
        integers[2],
        integers[3],
        integers[4],
        integers[5],
        integers[6],
        numbers[2],
        numbers[3 : 3 + n],
        numbers[3 + n :],
    )
