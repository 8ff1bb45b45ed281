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
    """The plants of N arms, with bodies and obstacles where they can touch.

    Args:
        scenario: The scenario.
        rows: N.
        commands: h, the number of past commands shown.
    """
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
    """Draws the obstacles of some rows' episodes.

    Args:
        scenario: The scenario.
        contacts: Receives the obstacles.
        rows: The numbers of the rows. Shape (k,).
        episodes: Their trajectories.
        generators: One an episode, see :meth:`ikgym.Scenario.drawn_obstacles`.

    Raises:
        InvalidInputError: There is no room for an obstacle in an episode.
    """
    drawn = np.repeat([one.random for one in scenario.obstacles], [one.count for one in scenario.obstacles])
    numbers = scenario.drawn_obstacles(episodes, generators)
    for row, own in zip(rows.tolist(), numbers, strict=True):
        contacts.boxes[row][:, drawn] = own[drawn]


def pair_names(scenario: Scenario, pair: Sequence[int]) -> tuple[str, str]:
    """The names of a pair that :meth:`ikgym.Arm.clearance` or an outcome has."""
    names = (*scenario.arm.bodies.names, *(one for obstacle in scenario.obstacles for one in obstacle.names))
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
