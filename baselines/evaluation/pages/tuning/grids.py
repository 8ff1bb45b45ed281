"""The search grids: what is tried for each solver, in stages, each of which starts from the best of the stage before.

A solver may not look further ahead than it does as it is, so no grid has a horizon in it.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

#: The parameters of each trial of a stage, by name; each is added to the best of the stage before.
Stage = Sequence[Mapping[str, Any]]


def product(**values: Sequence[Any]) -> list[Mapping[str, Any]]:
    """All combinations of some parameters' values."""
    return [dict(zip(values, chosen, strict=True)) for chosen in itertools.product(*values.values())]


def decades(low: int, high: int, each: int = 2) -> tuple[float, ...]:
    """Numbers from 10^low to 10^high, so many in a decade, each with two digits."""
    return tuple(float(f"{10.0 ** (low + k / each):.2g}") for k in range((high - low) * each + 1))


# Below 0.003 an error outlives the episode; 2 is the limit of stability.
GAINS = (0.003, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0, 1.5)
FINE_GAINS = (0.005, 0.007, 0.015, 0.02, 0.05, 0.07, 0.15, 0.2, 0.45, 0.8, 1.2)
_JOINTS = 7
RATIOS = (0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.2, 1.4, 2.0)
#: Weights of the joints from the base to the tool: a geometric row.
WEIGHTS = tuple(tuple(float(f"{ratio**j:.3g}") for j in range(_JOINTS)) for ratio in RATIOS)
#: A heavily damped iteration that is given more makes all of them, in each period.
_ITERATIONS = (1, 10)
_DESCENT: tuple[Stage, ...] = (
    product(alpha_start=("kept",), alpha_max=(5e-5, 1e-4, 2e-4, 3e-4), tolerance=(4.0, 20.0, 80.0)),
    product(iterations=(150, 1500)) + product(alpha_factor=(1.5,)),
)

#: The stages of each solver.
GRIDS: Mapping[str, tuple[Stage, ...]] = {
    "moore_penrose": (product(gain=GAINS, rank_tolerance=(1e-12, 1e-4, 1e-3, 1e-2, 3e-2, 0.1)),),
    "weighted_pseudoinverse": (
        product(gain=GAINS, rank_tolerance=(1e-12, 1e-3, 1e-2, 3e-2)),
        product(weights=WEIGHTS, rank_tolerance=(1e-12, 1e-4, 1e-3, 1e-2, 3e-2)),
        product(gain=FINE_GAINS),
    ),
    "truncated_svd": (product(gain=GAINS, threshold=decades(-4, -1)), product(gain=FINE_GAINS)),
    "gram_schmidt": (product(gain=GAINS, truncation=decades(-5, -1)), product(gain=FINE_GAINS)),
    "jacobian_transpose:length=1.0": (product(gain=GAINS + FINE_GAINS),),
    "dls": (product(gain=GAINS, damping=decades(-6, 0)), product(gain=FINE_GAINS)),
    "full_orientation:policy=rhc,options={'horizon': 3, 'iterations': 1}": (
        [
            {"options": {"horizon": 3, "iterations": 1, "terminal_weight": weight}}
            for weight in (10.0, 30.0, 50.0, 70.0, 100.0, 150.0, 200.0, 300.0, 500.0, 1e3)
        ],
    ),
    "full_orientation": (
        [{"options": options} for options in product(gain=(0.1, 0.15, 0.3, 0.6, 1.0), damping=decades(-3, -1))],
    ),
    "broyden": (
        product(gain=GAINS, damping=decades(-6, -1)),
        product(motion=(1e-10, 1e-8, 1e-7, 1e-5, 1e-4, 1e-3, 1e-2)) + product(learns=("jacobian",)),
        product(gain=FINE_GAINS),
    ),
    "null_space": (
        product(gain=GAINS, damping=decades(-5, -1)),
        product(objective=("posture", "manipulability"), secondary_gain=(0.0, *decades(-2, 2))),
        product(damping=decades(-5, -1), secondary_gain=decades(0, 2)),
        product(gain=FINE_GAINS),
    ),
    "mfac": (
        [
            *product(rule=("constant",), damping=(0.0, *decades(-6, 0)), iterations=_ITERATIONS),
            *product(rule=("error_ratio", "threshold"), damping=decades(-5, -1, 1), iterations=_ITERATIONS),
            *product(rule=("sugihara",), weight=(1e-2, 1.0, 1e2), damping=(1e-5, 1e-3), iterations=_ITERATIONS),
            *product(rule=("chan",), weight=decades(-3, 6, 1), iterations=_ITERATIONS),
            *product(rule=("condition", "table"), iterations=_ITERATIONS),
        ],
        product(one_step=(True,)) + product(iterations=(2, 3, 5, 30, 500)) + product(tolerance=(1e-5, 1e-4, 1e-3)),
    ),
    "mfapc": (
        [
            *product(rule=("constant",), damping=(0.0, *decades(-5, 1, 1)), iterations=_ITERATIONS),
            *product(rule=("error_ratio", "threshold"), damping=decades(-5, -2, 1), iterations=_ITERATIONS),
            *product(rule=("sugihara",), weight=(1.0, 1e2), damping=(1e-5, 1e-3), iterations=_ITERATIONS),
            *product(rule=("chan",), weight=(1e-2, 1.0, 1e2, 1e4, 1e6), iterations=_ITERATIONS),
            *product(rule=("condition", "table"), iterations=_ITERATIONS),
        ],
        product(jacobians=("predicted", "constant"), stop=("horizon", "first_point"), iterations=(1, 3, 10))
        + product(one_step=(True,)),
    ),
    "rhc_gradient": _DESCENT,
    "rhc:horizon=3": (
        product(terminal_weight=(0.0, 0.3, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 1e4)),
        product(terminal_weight=(50.0, 70.0, 150.0, 200.0, 500.0, 700.0)),
    ),
    "rhc:horizon=3,iterations=1": (
        product(terminal_weight=(0.0, 0.3, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 1e4)),
        product(terminal_weight=(50.0, 70.0, 150.0, 200.0, 500.0, 700.0)),
    ),
}
