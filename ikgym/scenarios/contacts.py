"""Bodies and obstacles of a scenario, as its simulation has them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.kernels.bodies import OBSTACLE, PLACED
from ikgym.kernels.cost import NO_PROXIMITY
from ikgym.kernels.outcome import Outcome
from ikgym.kernels.random_numbers import CUT
from ikgym.plant.contact import Contacts
from ikgym.plant.rows import PlantRows
from ikgym.plant.sweep import drift, sweep
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
    arm, plant, travel = scenario.arm, scenario.plant, scenario.joint_bound()
    shapes, n, obstacles = arm.bodies.shapes, arm.joints, boxes.shape[2]
    longer = CUT * math.sqrt(3.0) * float(np.max(plant.calibration)) * plant.link
    return Contacts(
        links=shapes.links,
        radii=shapes.radii,
        sizes=shapes.sizes,
        pairs=shapes.pairs,
        sweep=sweep(arm, travel, longer),
        checked=scenario.surroundings.checked,
        boxes=boxes,
        drift=drift(boxes[0], arm.reach(travel)),
        shown=obstacles if scenario.obstacles_shown else 0,
        proximity=NO_PROXIMITY if scenario.proximity is None else scenario.proximity.parameters,
        starts=np.tile(shapes.starts, (rows, 2, 1, 1)),
        ends=np.tile(shapes.ends, (rows, 2, 1, 1)),
        distance=np.full(rows, np.inf),
        pair=np.full((rows, 2), -1),
        stopped=np.zeros(rows, dtype=np.bool_),
        before=np.zeros((rows, n)),
        between=np.zeros((rows, n)),
        joints=np.zeros((rows, n, 6)),
        placed=np.zeros((rows, len(shapes.links), PLACED)),
        moving=np.zeros((rows, obstacles, OBSTACLE)),
        core=np.zeros((rows, 6)),
    )


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
    for row, boxes in zip(rows.tolist(), numbers, strict=True):
        contacts.boxes[row][:, drawn] = boxes[drawn]


def check_clear(scenario: Scenario, out: Outcome, active: BoolArray, q: FloatArray) -> None:
    """Checks that arms touch nothing at the start of their episodes; shapes (N,) and (N, n)."""
    touching = np.flatnonzero(active & (out.clearance <= 0.0) & (out.stopped == 0.0))
    if len(touching):
        row = int(touching[0])
        first, second = scenario.pair_names(out.pair[row].astype(np.int64).tolist())
        raise InvalidInputError(
            f"Start of scenario {scenario.name!r}: expected an arm that touches nothing, got {first!r} and {second!r} "
            f"with {1e3 * out.clearance[row]:.3g} mm between them at q = {q[row].tolist()}. A pair that may touch is "
            "named by `ignored` of the bodies or of the obstacle."
        )
