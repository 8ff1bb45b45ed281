"""`told` knows the arm that moves and its drives, and is a reference."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import Seeds, rollout
from baselines.oracle.stripped import strip_plant
from ikgym import Plant
from ikgym.exceptions import InvalidInputError

SEED = 1_000_000
PLAIN = ikgym.scenarios.get("panda-ideal").replace(steps=80)
RHC = {"horizon": 8}
CALIBRATION = Plant(zero=5e-4, link=3e-4, axis=5e-4)


def played(plant, name, draw=None, **parameters):
    scenario = PLAIN.replace(plant=plant)
    return rollout(scenario, baselines.make(name, scenario, **parameters), draw or SEED, timed=False)


def told(plant, draw=None, **parameters):
    return played(plant, "told", draw, policy="rhc", **{"options": RHC, "seed": SEED, **parameters})


def test_it_tracks_the_arm_that_moves():
    known, unknown = told(CALIBRATION), played(CALIBRATION, "rhc", **RHC)
    assert known.position_error[-1] < 1e-5
    assert unknown.position_error[-1] > 2e-4
    assert known.tracking_cost.sum() < unknown.tracking_cost.sum()


def test_another_arm_seed_is_another_arm():
    right, wrong = (told(CALIBRATION, Seeds(SEED, arm_seed=3), arm_seed=seed) for seed in (3, 4))
    assert right.position_error[-1] < 1e-5
    assert wrong.position_error[-1] > 1e-4


def test_a_payload_is_known_once_it_is_there():
    """The one that was drawn, where its mass belongs to the context; also for the oracle, without drives."""
    plant = Plant(payload=5e-4, payload_step=30, load=(1.0, 3.0))
    drawn = PLAIN.replace(plant=plant).drawn_plant(SEED)
    same = Plant(payload=5e-4 * (2.0 + drawn.context[0]), payload_step=30)
    assert drawn.payload == pytest.approx(same.payload, rel=1e-12)
    assert strip_plant(PLAIN.replace(plant=plant), SEED).plant == Plant(payload=drawn.payload, payload_step=30)
    episode = told(plant)
    np.testing.assert_allclose(episode.q, told(same).q, rtol=1e-9)
    assert episode.position_error[28] < 1e-5
    assert episode.position_error[29:32].max() > 1e-4
    assert episode.position_error[-1] < 1e-5


def test_delay_and_lag_are_known():
    late = Plant(bandwidth=(10.0, 20.0), command_delay=(2, 12))
    known, unknown = told(late), played(late, "rhc", **RHC)
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


def test_drives_that_no_policy_can_be_told_are_refused():
    scenario = PLAIN.replace(plant=Plant(gain=0.9, resonance=20.0, bandwidth=10.0))
    with pytest.raises(InvalidInputError, match=r"expected drives with delays and lags alone, .* got gain, resonance"):
        baselines.make("told", scenario, seed=SEED)


def test_on_an_ideal_plant_it_is_the_policy_itself():
    assert np.array_equal(told(Plant()).q, played(Plant(), "rhc", **RHC).q)
