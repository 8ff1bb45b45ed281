"""Each effect arrives: in the motion, in the observation or in both, at its size, and nowhere else."""

import numpy as np
import pytest

import ikgym
from ikgym import Plant
from ikgym.kernels.rotations import geodesic_angle
from tests.comparison import identical
from tests.limited import limited
from tests.plant.effects import ALL, panda

STEPS = 60


class Played:
    """An episode: what is seen at each step and at the reset, the info after each step, and what is true."""

    def __init__(self, plant, command=None, steps=STEPS, seed=3, scenario=None, **made):
        self.scenario = (panda(steps=steps) if scenario is None else scenario).replace(plant=plant, steps=steps)
        env = ikgym.RedundantIKEnv(self.scenario, **made)
        rng = np.random.default_rng(0)
        self.seen, self.infos, self.true_q = [env.reset(seed=seed)[0]], [], [env._simulator.true_q[0].copy()]
        for k in range(steps):
            action = rng.uniform(-0.02, 0.02, env.action_space.shape[0]) if command is None else command(k)
            seen, *_, info = env.step(action)
            self.seen.append(seen)
            self.infos.append(info)
            self.true_q.append(env._simulator.true_q[0].copy())

    def of(self, key):
        return np.array([one[key] for one in self.seen])

    def told_of(self, key):
        return np.array([one[key] for one in self.infos])

    def poses(self, arm, q=None):
        """Task coordinates of an arm, at the true joint coordinates."""
        return self.scenario.task.coordinates(*arm.forward(self.true_q if q is None else q))


@pytest.fixture(scope="module")
def ideal():
    """Of the arm in the data sheet."""
    return Played(Plant())


#: What the sensors alone do leaves the motion and its cost as they are.
SENSORS = {
    "q_noise": 1e-4,
    "pose_noise": 1e-3,
    "pose_rotation_noise": 1e-3,
    "q_delay": 2,
    "pose_delay": 3,
    "pose_every": 4,
    "pose_missing": 0.5,
}


@pytest.mark.parametrize("name", SENSORS)
def test_sensors_change_what_is_seen_and_nothing_else(name, ideal):
    played = Played(Plant(**{name: SENSORS[name]}))
    assert identical(played.true_q, ideal.true_q)
    assert identical(played.infos, ideal.infos)
    other = "q" if name.startswith("q") else "pose"
    for key in ("q", "qdot", "pose", "nominal", "remaining"):
        assert identical(played.of(key), ideal.of(key)) is (key != other)
    assert ("pose_age" in played.seen[0]) is ("q_age" in played.seen[0]) is (name not in {*SENSORS} - LATE)


LATE = {"q_delay", "pose_delay", "pose_every", "pose_missing"}


def test_noise_of_the_encoders():
    deviation = np.array([1e-4, 0, 2e-4, 1e-4, 1e-4, 1e-4, 1e-4])
    played = Played(Plant(q_noise=tuple(deviation)), steps=1500)
    noise = played.of("q") - played.true_q
    np.testing.assert_allclose(noise.std(axis=0), deviation, rtol=0.08)
    assert not noise[:, 1].any()
    assert abs(np.corrcoef(noise[:, [0, 2, 3]].T) - np.eye(3)).max() < 0.1
    assert abs(np.corrcoef(noise[1:, 0], noise[:-1, 0])[0, 1]) < 0.1


def test_noise_of_the_camera():
    played = Played(Plant(pose_noise=1e-3, pose_rotation_noise=2e-3), steps=1500)
    true = played.poses(played.scenario.arm)
    shift = (played.of("pose") - true)[:, 9:]
    np.testing.assert_allclose(shift.std(axis=0), 1e-3, rtol=0.08)
    assert abs(np.corrcoef(shift.T) - np.eye(3)).max() < 0.1
    rotations = played.of("pose")[:, :9].reshape(-1, 3, 3)
    np.testing.assert_allclose(rotations @ rotations.transpose(0, 2, 1), np.tile(np.eye(3), (1501, 1, 1)), atol=1e-14)
    between = rotations @ true[:, :9].reshape(-1, 3, 3).transpose(0, 2, 1)
    vectors = np.stack([between[:, 2, 1], between[:, 0, 2], between[:, 1, 0]], axis=1)
    np.testing.assert_allclose(vectors.std(axis=0), 2e-3, rtol=0.08)
    angles = [geodesic_angle(one, np.eye(3)) for one in between]
    np.testing.assert_allclose(np.square(angles).mean(), 3 * 2e-3**2, rtol=0.1)


def test_noise_stays_with_its_measurement_and_is_no_other_with_more_effects_on():
    alone, with_more = Played(Plant(q_noise=1e-4)), Played(Plant(q_noise=1e-4, q_delay=3, pose_noise=1e-3))
    assert identical(with_more.of("q")[3:], alone.of("q")[:-3])
    late, soon = Played(Plant(pose_noise=1e-3, pose_delay=5)), Played(Plant(pose_noise=1e-3, q_noise=1e-3))
    assert identical(late.of("pose")[5:], soon.of("pose")[:-5])


def test_late_encoders():
    played = Played(Plant(q_delay=4))
    ages = np.minimum(np.arange(STEPS + 1), 4)
    assert identical(played.of("q_age"), ages[:, None].astype(float))
    assert identical(played.of("q"), np.array(played.true_q)[np.arange(STEPS + 1) - ages])
    assert not played.of("pose_age").any()


@pytest.mark.parametrize(("every", "delay"), [(1, 5), (7, 0), (7, 3), (3, 7), (4, 8), (1, STEPS), (STEPS + 5, 2)])
def test_a_slow_and_late_camera(every, delay, ideal):
    """The newest measurement that has arrived, of the steps 0, E, 2 E, …"""
    played = Played(Plant(pose_every=every, pose_delay=delay))
    steps = np.arange(STEPS + 1)
    newest = np.maximum((steps - delay) // every * every, 0)
    assert identical(played.of("pose_age")[:, 0], (steps - newest).astype(float))
    assert identical(played.of("pose"), ideal.of("pose")[newest])
    assert not played.of("q_age").any()


def test_missing_poses():
    played = Played(Plant(pose_missing=0.3, pose_every=2, pose_delay=1), steps=3000)
    steps, ages = np.arange(3001), played.of("pose_age")[:, 0].astype(int)
    assert identical(played.of("pose"), played.poses(played.scenario.arm)[steps - ages])
    measured = np.unique(steps - ages)
    assert (measured % 2 == 0).all()
    assert ages[0] == 0
    assert abs(1 - len(measured) / 1500 - 0.3) < 0.05
    never = Played(Plant(pose_missing=1.0))
    assert identical(never.of("pose")[-1], never.of("pose")[0])
    assert never.of("pose_age")[-1] == STEPS


def test_kinematics_are_those_of_the_drawn_arm(ideal):
    """In the pose that is seen, and in errors and costs."""
    plant = Plant(zero=5e-3, link=1e-3, axis=5e-3, payload=0.01, payload_step=20)
    played = Played(plant)
    moved, usual = (np.array(one.true_q) - one.true_q[0] for one in (played, ideal))
    np.testing.assert_allclose(moved, usual, atol=1e-14)  # from another start, that of the arm that moves
    drawn = played.scenario.drawn_plant(3)
    before, after = played.poses(drawn.arm), played.poses(drawn.loaded_arm)
    wanted = np.concatenate([before[:20], after[20:]])
    assert identical(played.of("pose"), wanted)
    assert np.abs(wanted - ideal.of("pose")).max() > 2e-3
    nominal = played.scenario.nominal(3)[1:]
    errors = np.linalg.norm((nominal - wanted[1:])[:, 9:], axis=1)
    np.testing.assert_allclose(played.told_of("position_error"), errors, rtol=1e-12)
    task, cost = played.scenario.task, played.scenario.cost
    costs = [cost.tracking(task.error(*pair)) for pair in zip(nominal, wanted[1:], strict=True)]
    np.testing.assert_allclose(played.told_of("tracking_cost"), costs, rtol=1e-9)


def test_a_command_comes_late(ideal):
    played = Played(Plant(command_delay=5))
    assert identical(np.array(played.true_q)[:6], np.tile(played.true_q[0], (6, 1)))
    assert identical(played.of("qdot")[5:], ideal.of("qdot")[:-5])
    np.testing.assert_allclose(np.array(played.true_q)[5:], np.array(ideal.true_q)[:-5], rtol=0, atol=1e-15)


def test_a_drive_lags_behind_its_command():
    """The answer to a step; what is observed and charged is the command."""
    played = Played(Plant(bandwidth=15.0), command=lambda k: np.full(7, 0.003))  # within the limits of acceleration
    asked = 0.003 * played.scenario.velocity_limit
    velocity = np.diff(played.true_q, axis=0) / played.scenario.dt
    k = np.arange(1, STEPS + 1)[:, None]
    time_constant = 1.0 / (2.0 * np.pi * 15.0)
    np.testing.assert_allclose(velocity, asked * (1.0 - np.exp(-k * played.scenario.dt / time_constant)), rtol=1e-6)
    straight = Played(Plant(), command=lambda k: np.full(7, 0.003))
    assert identical(played.of("qdot"), straight.of("qdot"))
    assert identical(played.told_of("velocity_cost"), straight.told_of("velocity_cost"))


def test_backlash_is_lost_where_a_drive_turns():
    """Half of it at the start, all of it where the direction changes."""
    there, back = np.full(7, 0.01), np.full(7, -0.01)
    played, free = (
        Played(plant, command=lambda k: there if k < 30 else back) for plant in (Plant(backlash=1e-4), Plant())
    )
    way, wanted = (np.array(one.true_q) - one.true_q[0] for one in (played, free))
    np.testing.assert_allclose(way[30], wanted[30] - 0.5e-4, atol=1e-12)
    np.testing.assert_allclose(way[-1] - way[30], wanted[-1] - wanted[30] + 1e-4, atol=1e-12)
    assert identical(played.of("q"), np.array(played.true_q))
    assert identical(played.of("qdot"), free.of("qdot"))


def test_commands_are_shown_newest_first():
    played = Played(ALL, commands=3)
    rng = np.random.default_rng(0)
    given = [np.zeros(7)] * 3 + [rng.uniform(-0.02, 0.02, 7) * played.scenario.velocity_limit for _ in range(STEPS)]
    for k, shown in enumerate(played.of("commands")):
        np.testing.assert_array_equal(shown, given[k : k + 3][::-1])
    fast = Played(ALL.replace(arms=()), commands=1, scenario=limited(), steps=5, command=lambda k: np.ones(7))
    assert identical(fast.of("commands")[1:, 0], np.tile(fast.scenario.largest_qdot, (5, 1)))


@pytest.mark.parametrize("task", ["position", "axis", "skew", "matrix", "pose"])
def test_all_effects_at_any_task_within_the_bounds_of_the_space(task):
    scenario = panda(ALL.replace(pose_noise=0.1, q_noise=0.1), steps=12, task=ikgym.tasks.get(task))
    env = ikgym.RedundantIKEnv(scenario, commands=2)
    for seed in range(3):
        seen, _ = env.reset(seed=seed)
        for _ in range(scenario.steps):
            assert env.observation_space.contains(seen)
            assert [*seen] == ["q", "qdot", "pose", "nominal", "remaining", "q_age", "pose_age", "commands"]
            seen, *_ = env.step(env.action_space.sample())
