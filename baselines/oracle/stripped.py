"""An episode on its true kinematics, without drives and sensors: the best known costs of imperfect plants belong to it.

A cost ratio is stated against the cheapest path that the very arm of the episode can go, and no policy that moves it
through lagging drives or sees it through a noisy camera comes to 1. Scenarios of equal kinematics have the same best
known costs, whatever their drives and sensors.
"""

from __future__ import annotations

import numpy as np

from ikgym.plant import Plant
from ikgym.scenarios import Scenario

#: Note where drives and sensors are left out.
NOTE = "without drives and sensors"


def strip_plant(scenario: Scenario, seed: int, arm_seed: int | None = None) -> Scenario:
    """The scenario in which the arm of one episode moves, ideally driven and measured.

    Of the plant nothing is left but the payload, which the arm takes up on the way; a scenario whose plant is ideal
    stays as it is. ``arm_seed`` says which arm moves; that of the seed if left out.

    Raises:
        InvalidInputError: There is an arm_seed, and nothing that it could choose.
    """
    plant = scenario.plant
    if plant.ideal and arm_seed is None:
        return scenario
    drawn = scenario.drawn_plant(seed, arm_seed)
    kept = Plant(payload=drawn.payload, payload_step=plant.payload_step) if np.any(plant.payload) else Plant()
    start = scenario.start_of(seed, arm_seed) if scenario.shifts_start else scenario.start
    return scenario.replace(
        arm=drawn.arm, model=scenario.model, plant=kept, start=start, obstacles=scenario.obstacles_of(seed)
    )


def ideal(scenario: Scenario, seed: int | None = None) -> Scenario:
    """The scenario with the arm of the data sheet, ideally driven and measured, and the obstacles of a reset seed."""
    if scenario.plant.ideal:
        return scenario
    return scenario.replace(plant=Plant(), **({} if seed is None else {"obstacles": scenario.obstacles_of(seed)}))


def strips(scenario: Scenario) -> bool:
    """Whether a scenario has drives or sensors that are left out."""
    kinematics = {name: getattr(scenario.plant, name) for name in KINEMATICS}
    return not scenario.plant.ideal and Plant(**kinematics) != scenario.plant


#: The fields of a plant that say which arm moves.
KINEMATICS = ("zero", "link", "axis", "payload", "payload_step", "arms", "calibration", "load", "from_middle")
