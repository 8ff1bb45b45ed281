"""Scenarios of imperfect plants: the same gentle paths, and plants as they are said to be."""

import numpy as np
import pytest

import ikgym
from baselines.fingerprints import fingerprint
from baselines.oracle.stripped import ideal, strip_plant

NAMES = ikgym.scenarios.names("plants")
PLAIN = ikgym.scenarios.get("panda-ideal")


@pytest.mark.parametrize("name", NAMES)
def test_without_their_plants_they_are_the_same(name):
    assert fingerprint(ideal(ikgym.scenarios.get(name))) == fingerprint(PLAIN)


def test_one_of_them_is_ideal():
    assert [name for name in NAMES if ikgym.scenarios.get(name).plant.ideal] == ["panda-ideal"]


def test_the_field_has_the_others_at_its_ends():
    worst = ikgym.scenarios.get("panda-field").plant.scaled(2.0)
    assert worst.scaled(0.0, 1.0) == ikgym.scenarios.get("panda-bus").plant
    assert worst.scaled(0.5, 0.0).zero == ikgym.scenarios.get("panda-camera").plant.zero


def test_three_of_them_draw_the_same_arms():
    plants = [ikgym.scenarios.get(f"panda-{name}").plant for name in ("camera", "camera-slow", "same-arm")]
    for name in ("zero", "link", "axis", "payload", "arms"):
        assert len({getattr(plant, name) for plant in plants}) == 1


@pytest.mark.parametrize("name", NAMES)
def test_the_arm_that_moves_begins_on_its_path(name):
    """An operator jogs it there; where the data sheet's arm moves nothing is changed by a bit."""
    scenario, draws = ikgym.scenarios.get(name), [1_000_000, 1_000_001]
    env = ikgym.RedundantIKVectorEnv(2, scenario)
    env.reset(seed=draws)
    nominal = scenario.first_q_of([scenario.episode(seed) for seed in draws])
    plain = not scenario.plant.other_arm
    for row, seed in enumerate(draws):
        start = scenario.start_of(seed)
        np.testing.assert_array_equal(env._simulator.true_q[row], start)
        arm = scenario.arm if plain else scenario.drawn_plant(seed).arm
        error = scenario.task.error(scenario.nominal(seed)[0], scenario.task.coordinates(*arm.forward(start)))
        assert abs(error).max() < 1e-9
        assert np.array_equal(start, nominal[row]) == plain
        np.testing.assert_array_equal(strip_plant(scenario, seed).start_of(seed), start)


def test_an_arm_that_is_kept_is_jogged_and_a_start_that_is_given_is_not():
    scenario = ikgym.scenarios.get("panda-camera")
    env = ikgym.RedundantIKEnv(scenario)
    env.reset(seed=1, options={"arm_seed": 5})
    np.testing.assert_array_equal(env._simulator.true_q[0], scenario.start_of(1, 5))
    assert abs(scenario.start_of(1, 5) - scenario.start_of(1)).max() > 1e-5
    q = scenario.first_q(scenario.episode(1))
    env.reset(seed=1, options={"q": q})
    np.testing.assert_array_equal(env._simulator.true_q[0], q)
    given = scenario.replace(start=q)
    assert not given.shifts_start
    np.testing.assert_array_equal(given.start_of(1), q)
