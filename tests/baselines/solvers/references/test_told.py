"""`told` knows the arm that moves and its drives, and is a reference."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.oracle.stripped import stripped
from baselines.recording import Seeds
from ikgym import Plant
from ikgym.exceptions import InvalidInputError

SEED = 1_000_000
PLAIN = ikgym.scenarios.get("panda-ideal").replace(steps=120)
RHC = {"horizon": 10}
CALIBRATION = Plant(zero=5e-4, link=3e-4, axis=5e-4)


def cost(plant, name, draw=None, **parameters):
    scenario = PLAIN.replace(plant=plant)
    policy = baselines.make(name, scenario, **parameters)
    episode = rollout(scenario, policy, draw or SEED, timed=False)
    return float((episode.tracking_cost + episode.velocity_cost).sum()), episode


def told(plant, draw=None, **parameters):
    return cost(plant, "told", draw, policy="rhc", **{"options": RHC, "seed": SEED, **parameters})


def test_it_tracks_the_arm_that_moves():
    (known, episode), (unknown, other) = told(CALIBRATION), cost(CALIBRATION, "rhc", **RHC)
    assert episode.position_error[-1] < 1e-5
    assert other.position_error[-1] > 2e-4
    assert known < unknown


def test_another_arm_seed_is_another_arm():
    _, right = told(CALIBRATION, Seeds(SEED, arm_seed=3), arm_seed=3)
    _, wrong = told(CALIBRATION, Seeds(SEED, arm_seed=3), arm_seed=4)
    assert right.position_error[-1] < 1e-5
    assert wrong.position_error[-1] > 1e-4


def test_a_payload_is_known_once_it_is_there():
    _, episode = told(Plant(payload=1e-3, payload_step=60))
    assert episode.position_error[58] < 1e-5
    assert episode.position_error[59:62].max() > 1e-4
    assert episode.position_error[-1] < 1e-5


def test_the_payload_of_a_context_is_the_one_that_was_drawn():
    """Also for the oracle, which plays without drives and sensors."""
    plant = Plant(payload=1e-3, payload_step=60, load=(1.0, 3.0))
    drawn = PLAIN.replace(plant=plant).drawn_plant(SEED)
    same = Plant(payload=1e-3 * (2.0 + drawn.context[0]), payload_step=60)
    assert drawn.payload == pytest.approx(same.payload, rel=1e-12)
    assert told(plant)[0] == pytest.approx(told(same)[0], rel=1e-6)
    assert stripped(PLAIN.replace(plant=plant), SEED).plant == Plant(payload=drawn.payload, payload_step=60)


def test_delay_and_lag_are_known():
    late = Plant(bandwidth=(10.0, 20.0), command_delay=(2, 12))
    _, known = told(late)
    _, unknown = cost(late, "rhc", **RHC)
    assert known.position_error.max() < 1e-3
    assert unknown.position_error.max() > 2.0 * known.position_error.max()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({}, "a seed says which episode"),
        ({"seed": -1}, "seed: expected a whole number of at least 0"),
        ({"seed": SEED, "policy": "oracle"}, "got the reference 'oracle'"),
        ({"seed": SEED, "arm_seed": 1}, "arm_seed"),
    ],
)
def test_bad_input(parameters, words):
    with pytest.raises(InvalidInputError, match=words):
        baselines.make("told", PLAIN, **parameters)


def test_on_an_ideal_plant_it_is_the_policy_itself():
    (alone, one), (itself, other) = told(Plant()), cost(Plant(), "rhc", **RHC)
    assert alone == itself
    assert np.array_equal(one.q, other.q)
