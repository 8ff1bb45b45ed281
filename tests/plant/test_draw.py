"""What an episode draws: of the right size, from separate streams, and the same in all calls."""

import numpy as np
import pytest

import ikgym
from baselines.fingerprints import fingerprint
from ikgym import Plant
from ikgym.exceptions import InvalidInputError
from ikgym.plant.draw import Draws, episode_key
from tests.comparison import identical
from tests.plant.effects import ALL, panda

PANDA = ikgym.arms.get("panda")
KEYS = np.random.default_rng(0).integers(2**63, size=2000, dtype=np.uint64)
ROWS = np.arange(len(KEYS))


def arms(plant, arm=PANDA):
    """The arms that all keys draw, unloaded."""
    draws = Draws(plant, arm)
    out = draws.blank(len(KEYS))
    draws.arms(KEYS, ROWS, draws.numbers(KEYS)[0], out)
    return type(out)(*[part[:, 0] for part in out])


def close(numbers, deviation):
    """Whether a mean of 0 and a standard deviation are met, as nearly as the number of samples allows."""
    return abs(numbers.mean()) < 0.1 * deviation and abs(numbers.std() / deviation - 1.0) < 0.06


@pytest.mark.parametrize("kind", [np.random.PCG64, np.random.MT19937])
def test_the_key_of_an_episode_is_that_of_numpy(kind):
    """It draws the same 63 bits, and leaves the generator where that does."""
    ours, theirs = np.random.Generator(kind(7)), np.random.Generator(kind(7))
    for _ in range(20):
        assert episode_key(Plant(zero=0.01), ours) == theirs.integers(2**63, dtype=np.uint64)
    assert ours.random() == theirs.random()


def test_zeros_shift_joints():
    hinge = ikgym.Arm("hinge", [[0, 0, 1]], [[0, 0, 1]], (), [1, 0, 0])
    drawn = arms(Plant(zero=0.01), hinge)
    assert close(np.arctan2(drawn.tool[:, 1], drawn.tool[:, 0]), 0.01)
    slide = ikgym.Arm("slide", [[0, 0, 1]], [[1, 0, 0]], (True,))
    assert close(arms(Plant(zero=0.01), slide).offsets[:, 0, 0], 0.01)
    single = Draws(Plant(zero=(0.0, *[0.0] * 5, 0.01)), PANDA).one(int(KEYS[0])).arm
    q = PANDA.home + np.eye(7)[6] * np.arctan2(*_about_z(PANDA, single))
    np.testing.assert_allclose(single.forward(PANDA.home)[0], PANDA.forward(q)[0], atol=1e-14)
    assert abs(q - PANDA.home)[6] > 1e-4


def _about_z(nominal, turned):
    """Sine and cosine of the angle between two tools that the last joint alone tells apart."""
    between = nominal.forward(nominal.home)[0].T @ turned.forward(nominal.home)[0]
    return between[1, 0], between[0, 0]


def test_a_payload_and_a_zero_are_shifts_of_q():
    """For all joints at once, at any posture."""
    payload = np.linspace(-0.02, 0.03, 7)
    drawn = Draws(Plant(payload=payload), PANDA).one(5)
    q = np.random.default_rng(1).uniform(-2, 2, (20, 7))
    assert identical(drawn.arm.forward(q), PANDA.forward(q))
    for got, wanted in zip(drawn.loaded_arm.forward(q), PANDA.forward(q + payload), strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-14)
    both = Draws(Plant(payload=payload, zero=0.01), PANDA).one(5)
    for got, wanted in zip(both.loaded_arm.forward(q), both.arm.forward(q + payload), strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-14)


def test_links_and_axes():
    drawn = arms(Plant(link=0.01))
    assert close(drawn.offsets - PANDA.offsets, 0.01)
    assert close(drawn.tool - PANDA.tool, 0.01)
    assert identical(drawn.axes[0], PANDA.axes)
    tilted = arms(Plant(axis=0.01)).axes
    np.testing.assert_allclose(np.linalg.norm(tilted, axis=-1), 1.0, atol=1e-15)
    for joint, axis in enumerate(PANDA.axes):
        across = np.linalg.svd(axis[None])[2][1:]
        assert close(tilted[:, joint] @ across.T, 0.01)
    assert identical(arms(Plant(axis=0.01)).offsets, np.tile(PANDA.offsets, (len(KEYS), 1, 1)))


def test_one_of_some_arms_is_taken():
    names = ("panda-2", "panda-3", "panda-4")
    given = [ikgym.arms.get(name) for name in names]
    drawn = arms(Plant(arms=given))
    which = [np.flatnonzero([identical(one, arm.offsets) for arm in given]).tolist() for one in drawn.offsets]
    counts = np.bincount(np.concatenate(which), minlength=3)
    assert counts.sum() == len(KEYS)
    assert abs(counts - len(KEYS) / 3).max() < 4 * len(KEYS) ** 0.5
    weak = [arm.replace(velocity_limit=None) for arm in given]
    one = Draws(Plant(arms=weak), PANDA).one(3).arm
    for limit in ("lower", "upper", "velocity_limit", "acceleration_limit"):
        assert identical(getattr(one, limit), getattr(PANDA, limit))


def numbers(plant):
    """What all keys draw from ranges, and the contexts."""
    return Draws(plant, PANDA).numbers(KEYS)


CONTEXT = ikgym.scenarios.get("learning-context").plant


def test_a_context_is_what_was_drawn_from_ranges():
    """Each of them independently, from end to end."""
    drawn, context = numbers(CONTEXT.replace(from_middle=(0.0, 1.0)))
    assert CONTEXT.context == drawn._fields
    for name, values, part in zip(drawn._fields, drawn, context.T, strict=True):
        low, high = getattr(CONTEXT, name)
        np.testing.assert_allclose(values, low + 0.5 * (part + 1.0) * (high - low), atol=1e-12)
        assert min(values) <= low + 0.01 * (high - low)
        assert max(values) >= high - 0.01 * (high - low)
        assert -1.0 <= part.min() <= part.max() <= 1.0
        assert abs(part.mean()) < 0.06
    for name in ("pose_every", "command_delay"):  # both ends as often as the others
        low, high = getattr(CONTEXT, name)
        counts = np.bincount(getattr(drawn, name).astype(int), minlength=high + 1)[low:]
        assert abs(counts - len(KEYS) / (high - low + 1)).max() < 4 * len(KEYS) ** 0.5
    assert abs(np.corrcoef(context.T) - np.eye(7)).max() < 0.1


def test_the_splits_of_a_context_meet_nowhere():
    """The inner half of each range is for training, and what is beyond for extrapolation; nothing else differs."""
    beyond = ikgym.scenarios.get("learning-context-beyond")
    assert CONTEXT.from_middle == (0.0, 0.5)
    assert beyond.plant == CONTEXT.replace(from_middle=(0.5, 1.0))
    fields = {"name": "learning-context", "plant": CONTEXT}
    assert fingerprint(beyond.replace(**fields)) == fingerprint(ikgym.scenarios.get("learning-context"))
    inner, outer = (abs(numbers(plant)[1]) for plant in (CONTEXT, beyond.plant))
    assert inner.max() <= 0.5 <= outer.min()
    continuous = [0, 2, 3, 4, 5]
    assert (inner.max(axis=0)[continuous] > 0.49).all()
    assert (outer.max(axis=0) > 0.99).all()
    assert (outer.min(axis=0)[continuous] < 0.51).all()


def test_calibration_and_load_are_factors():
    plant = Plant(zero=0.01, link=0.01, axis=0.01, payload=0.01)
    same = plant.replace(calibration=1.0, load=1.0)
    double = Plant(zero=0.02, link=0.02, axis=0.02, payload=0.03)
    drawn, wanted = (Draws(one, PANDA).one(5) for one in (plant.replace(calibration=2.0, load=3.0), double))
    assert identical(Draws(same, PANDA).one(5).loaded_arm.chain, Draws(plant, PANDA).one(5).loaded_arm.chain)
    assert drawn.payload == wanted.payload == 0.03
    for got, other in zip(drawn.loaded_arm.chain, wanted.loaded_arm.chain, strict=True):
        np.testing.assert_allclose(got, other, atol=1e-15)
    ranged = plant.replace(calibration=(0, 2), load=(1, 5))
    one = Draws(ranged, PANDA).one(5)
    factor, load = 1.0 + one.context[0], 3.0 + 2.0 * one.context[1]
    fixed = Draws(plant.replace(calibration=factor, load=load), PANDA).one(5)
    for got, other in zip(one.loaded_arm.chain, fixed.loaded_arm.chain, strict=True):
        np.testing.assert_allclose(got, other, atol=1e-15)
    home = np.full(7, 0.1)
    assert ranged.reach(PANDA, home) == plant.replace(calibration=2.0, load=5.0).reach(PANDA, home)
    assert ranged.reach(PANDA, home) > plant.reach(PANDA, home)


def test_switching_one_effect_on_shifts_no_other():
    """Scenarios of equal kinematic severity share their arms, and severities scale one draw."""
    kinematics = {"zero": 1e-3, "link": 2e-3, "axis": 3e-3}
    alone = panda(Plant(**kinematics)).drawn_plant(8).arm
    assert identical(panda(ALL.replace(**kinematics, arms=(), payload=0.0)).drawn_plant(8).arm.chain, alone.chain)
    link = panda(Plant(link=2e-3)).drawn_plant(8).arm
    larger = panda(Plant(link=4e-3, pose_every=3)).drawn_plant(8).arm
    np.testing.assert_allclose(larger.offsets - PANDA.offsets, 2 * (link.offsets - PANDA.offsets), atol=1e-15)
    assert panda(Plant(command_delay=(0, 9))).drawn_plant(8).command_delay == (
        panda(ALL.replace(command_delay=(0, 9))).drawn_plant(8).command_delay
    )


@pytest.mark.parametrize("name", ["panda-random", "panda-circle", "varga7-random"])
def test_the_drawn_plant_is_the_one_that_moves(name):
    scenario = ikgym.scenarios.get(name).replace(
        steps=20, plant=ALL.replace(arms=(), payload_step=7), dt=1e-3, iterations_per_point=1
    )
    env = ikgym.RedundantIKEnv(scenario)
    for seed, options in ((5, {}), (6, {}), (6, {"arm_seed": 9})):
        env.reset(seed=seed, options=options)
        drawn, rows = scenario.drawn_plant(seed, **options), env._simulator._plant
        for loaded, arm in enumerate((drawn.arm, drawn.loaded_arm)):
            for part in ("offsets", "axes", "tool", "tool_rotation"):
                assert identical(getattr(rows.arms, part)[0, loaded], getattr(arm, part))
        assert (rows.state.delay[0] == drawn.command_delay).all()
        assert rows.state.lag[0] == pytest.approx(1.0 - np.exp(-2 * np.pi * drawn.bandwidth * 1e-3), rel=1e-12)
        assert drawn.payload_step == 7


def test_an_ideal_plant_draws_nothing():
    generators = [np.random.default_rng(0) for _ in range(2)]
    scenario = panda()
    simulator = ikgym.simulator.Simulator(scenario, 1, 1)
    simulator.reset(np.ones(1, dtype=bool), generators[:1])
    scenario.trajectory.samples(generators[1:])
    assert generators[0].random() == generators[1].random()


def test_a_plant_that_is_drawn_needs_a_seed():
    with pytest.raises(InvalidInputError, match="'panda-random' draws its plant: a seed says which episode"):
        panda(Plant(zero=1e-3)).drawn_plant()
    still = panda(Plant(bandwidth=12.0, payload=1e-3)).drawn_plant()
    assert still.bandwidth == 12.0
    assert still.loaded_arm is not still.arm
    ideal = panda().drawn_plant()
    assert ideal.loaded_arm is ideal.arm
    assert identical(ideal.arm.chain, PANDA.chain)
    assert ideal.bandwidth == np.inf
