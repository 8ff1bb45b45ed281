"""Bodies and obstacles of a scenario, as its simulation has them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.kernels.bodies.proximity import OFF
from ikgym.kernels.outcome import Outcome
from ikgym.plant.contact import Contacts
from ikgym.plant.contact_rows import contact_rows
from ikgym.plant.rows import PlantRows
from ikgym.scenarios.scenario import Scenario
from ikgym.trajectories import Trajectory
from ikgym.validation import BoolArray, FloatArray


def plant_rows(scenario: Scenario, rows: int, commands: int) -> PlantRows:
    """The plants of N arms that show h past commands, with bodies and obstacles where they can touch."""
    contacts = contacts_of(scenario, rows) if scenario.collides else None
    return PlantRows(scenario.plant, scenario.arm, scenario.dt, rows, scenario.task.size, commands, contacts)


def contacts_of(scenario: Scenario, rows: int) -> Contacts:
    """Bodies and obstacles of N arms in a scenario with collisions."""
    boxes = np.tile(scenario.obstacle_rows(scenario.steps + 2), (rows if scenario.draws_obstacles else 1, 1, 1, 1))
    around, travel, shown = scenario.surroundings, scenario.joint_bound(), scenario.obstacles_shown
    near = OFF if scenario.proximity is None else scenario.proximity.parameters
    return contact_rows(scenario.arm, scenario.plant, around, boxes, travel, rows, shown, near)


def draw_obstacles(
    scenario: Scenario,
    contacts: Contacts,
    rows: npt.NDArray[np.int64],
    episodes: Sequence[Trajectory],
    generators: Sequence[np.random.Generator],
) -> None:
    """Draws the obstacles of the episodes of some rows, see :meth:`ikgym.Scenario.drawn_obstacles`."""
    drawn = np.repeat([one.random for one in scenario.obstacles], [one.count for one in scenario.obstacles])
    numbers = scenario.drawn_obstacles(episodes, generators)
    for row, own in zip(rows.tolist(), numbers, strict=True):
        contacts.boxes[row][:, drawn] = own[drawn]


def pair_names(scenario: Scenario, pair: Sequence[int]) -> tuple[str, str]:
    """The names of a pair that :meth:`ikgym.Arm.clearance` or an outcome has."""
    names = (*scenario.arm.bodies.names, *(one for obstacle in scenario.obstacles for one in obstacle.names))
    return names[pair[0]], names[pair[1]]


def check_clear(scenario: Scenario, out: Outcome, active: BoolArray, q: FloatArray) -> None:
    """Checks that arms touch nothing at the start of their episodes; shapes (N,) and (N, n)."""
    touching = np.flatnonzero(active & (out.clearance <= 0.0) & (out.stopped == 0.0))
    if len(touching):
        row = int(touching[0])
        first, second = pair_names(scenario, out.pair[row].astype(np.int64).tolist())
        raise InvalidInputError(
            f"Start of scenario {scenario.name!r}: expected an arm that touches nothing, got {first!r} and {second!r} "
            f"with {1e3 * out.clearance[row]:.3g} mm between them at q = {q[row].tolist()}. A pair that may touch is "
            "named by `ignored` of the bodies or of the obstacle."
        )
