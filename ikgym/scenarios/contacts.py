"""Bodies and obstacles of a scenario, as its simulation has them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.kernels.outcome import Outcome
from ikgym.plant.contact import Contacts
from ikgym.plant.contact_rows import contact_rows
from ikgym.scenarios.scenario import Scenario
from ikgym.validation import BoolArray, FloatArray


def contacts_of(scenario: Scenario, rows: int) -> Contacts:
    """Bodies and obstacles of N arms in a scenario with collisions."""
    boxes = scenario.obstacle_rows(scenario.steps + 2)[None]
    around, travel = scenario.surroundings, scenario.joint_bound()
    return contact_rows(scenario.arm, scenario.plant, around, boxes, travel, rows, scenario.obstacles_shown)


def pair_names(scenario: Scenario, pair: Sequence[int]) -> tuple[str, str]:
    """The names of a pair that :meth:`ikgym.Arm.clearance` or an outcome has."""
    names = (*scenario.arm.bodies.names, *(one.name for one in scenario.obstacles))
    return names[pair[0]], names[pair[1]]


def check_clear(scenario: Scenario, out: Outcome, active: BoolArray, q: FloatArray) -> None:
    """Checks that arms touch nothing at the start of their episodes.

    Args:
        scenario: The scenario.
        out: What is observed.
        active: Which arms are. Shape (N,).
        q: Their joint coordinates in [rad] or [m]. Shape (N, n).

    Raises:
        InvalidInputError: One does; the message names the pair, and how to let it touch.
    """
    touching = np.flatnonzero(active & (out.clearance <= 0.0) & (out.stopped == 0.0))
    if len(touching):
        row = int(touching[0])
        first, second = pair_names(scenario, out.pair[row].astype(np.int64).tolist())
        raise InvalidInputError(
            f"Start of scenario {scenario.name!r}: expected an arm that touches nothing, got {first!r} and {second!r} "
            f"with {1e3 * out.clearance[row]:.3g} mm between them at q = {q[row].tolist()}. A pair that may touch is "
            "named by `ignored` of the bodies or of the obstacle."
        )
