"""Plants of other severities."""

import math

from ikgym import Plant, scenarios

FIELD = scenarios.get("panda-field").plant.scaled(2.0)


def test_0_is_ideal_and_1_the_plant_itself():
    assert FIELD.scaled(0.0) == Plant()
    assert FIELD.scaled(1.0) == FIELD
    assert FIELD.scaled(0.0, 1.0) == scenarios.get("panda-bus").plant


def test_what_grows_in_proportion_and_what_in_whole_steps():
    half = FIELD.scaled(0.5, 0.25)
    assert (half.zero, half.link, half.axis, half.payload) == (5e-4, 3e-4, 5e-4, 5e-4)
    assert (half.pose_noise, half.pose_missing, half.pose_every) == (5e-4, 0.1, 17)
    assert half.bandwidth == (40.0, 80.0)  # a quarter of the time constant
    assert half.command_delay == (0, 3)
    assert half.payload_step == FIELD.payload_step


def test_single_numbers_and_one_a_joint():
    plant = Plant(
        zero=(1e-3, 2e-3), backlash=4e-4, bias=-1e-3, command_delay=4, bandwidth=10.0, q_delay=3, pose_delay=5
    )
    half = plant.scaled(0.5)
    assert (half.zero, half.backlash, half.bias) == ((5e-4, 1e-3), 2e-4, -5e-4)
    assert (half.command_delay, half.bandwidth, half.q_delay, half.pose_delay) == (2, 20.0, 2, 2)
    ranged = Plant(pose_noise=(0, 2e-3), pose_every=(1, 5), calibration=(0, 2)).scaled(0.5)
    assert (ranged.pose_noise, ranged.pose_every, ranged.calibration) == ((0.0, 1e-3), (1, 3), (0.0, 2.0))
    assert Plant(noise=1e-3).scaled(0.5).bandwidth == math.inf
