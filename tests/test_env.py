"""The single environment against its specification, Gymnasium's checker and Stable-Baselines3's."""

import re
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as sb3_check_env

import ikgym
from ikgym.arms.bodies import Bodies
from ikgym.env import OBSERVED, REPORTED
from ikgym.exceptions import ResetNeededError
from ikgym.kernels.outcome import SOMETIMES
from ikgym.obstacles import Sphere
from ikgym.trajectories import StraightLine
from tests.comparison import identical
from tests.every_scenario import every_scenario
from tests.limited import limited

#: A scenario of each task, of 2, 3, 6, 7 and 8 joints, random, held, with a late plant and with one drawn from ranges.
ONE_A_TASK = (
    *("varga7-fast", "varga7-random", "planar2-bent", "zhang3-helix", "zhang6-lspb", "khan8-q1", "panda-glue"),
    *("panda-camera", "learning-context"),
)


def make(scenario="varga7-fast", **kwargs):
    return gym.make("RedundantIK-v0", scenario=scenario, **kwargs)


@pytest.mark.parametrize("scenario", ONE_A_TASK)
def test_gymnasium_check_env(scenario):
    """Pictures, which take most of its time, of two scenarios; the tests of the rendering draw all."""
    drawn = scenario in ("panda-glue", "varga7-fast")
    check_env(make(scenario).unwrapped, skip_render_check=not drawn)


@pytest.mark.parametrize("scenario", ONE_A_TASK)
def test_stable_baselines3_check_env(scenario):
    """The contract's `nominal` of shape (p, m) earns one advice to flatten; flattened there is no warning at all."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sb3_check_env(make(scenario).unwrapped)
    assert [str(w.message)[:25] for w in caught] == ["Your observation nominal "]
    sb3_check_env(gym.wrappers.FlattenObservation(make(scenario)))


def with_obstacle(scenario):
    """An arm with a body, and an obstacle that moves."""
    upright = [*np.eye(3).ravel(), 0.0, 0.0, 0.0]
    arm = scenario.arm.replace(bodies=Bodies(["tool"], [scenario.joints], [[0, 0, 0]], radii=[0.01]))
    return {"arm": arm, "obstacles": [Sphere("ball", [0, 0, 90], 0.1, motion=StraightLine(upright, upright, 1.0, 0.1))]}


@pytest.mark.parametrize("scenario", ["varga7-fast", "zhang3-helix", "panda-camera"])
def test_docstring_tables_are_the_spaces(scenario):
    env = make(scenario, preview=(1, 4, 9)).unwrapped
    late = env.scenario.replace(plant=env.scenario.plant.replace(q_delay=1), **with_obstacle(env.scenario))
    shown = ikgym.RedundantIKEnv(late, preview=(1, 4, 9), commands=2).observation_space
    rows = dict(re.findall(r"\| `(\w+)` \| \(([^)]*)\) \|", ikgym.RedundantIKEnv.__doc__))
    sizes = {"n": env.scenario.joints, "m": env.scenario.task.size, "p": 3, "h": 2, "1": 1, "o": 1, "16": 16}
    shapes = {key: tuple(sizes[s.strip()] for s in text.split(",") if s.strip()) for key, text in rows.items()}
    assert shapes == {key: space.shape for key, space in shown.spaces.items()}
    assert tuple(shapes) == (*OBSERVED, *SOMETIMES)
    assert set(env.observation_space) == {*OBSERVED, *(SOMETIMES[:2] if env.scenario.plant.late else ())}
    assert all(space.dtype == np.float64 for space in shown.values())
    assert all(np.isfinite([space.low, space.high]).all() for space in shown.values())
    action = re.search(r"`(Box\([^`]*)` \| 1 \|", ikgym.RedundantIKEnv.__doc__)[1]
    assert str(env.action_space) == action.replace("n", str(sizes["n"])).replace(f"i{sizes['n']}", "in")
    env.reset(seed=0)
    info = env.step(np.zeros(sizes["n"], dtype=np.float32))[4]
    table = ikgym.RedundantIKEnv.__doc__.split("## Info")[1].split("After a reset")[0]
    assert tuple(re.findall(r"\| `(\w+)` \|", table)) == REPORTED
    absent = () if env.scenario.task.has_orientation else ("orientation_error",)
    assert tuple(info) == tuple(key for key in REPORTED if key not in absent)


def by_hand(scenario, actions, seed):
    """The specification, written with the public parts alone."""
    q = scenario.first_q(scenario.trajectory) if not scenario.random else scenario.nominal_joint_path(seed)[0]
    nominal, qdot, arm = scenario.nominal(seed, 2), np.zeros(scenario.joints), scenario.arm
    for k, action in enumerate(actions):
        command = np.clip(action.astype(np.float64), -1, 1) * scenario.velocity_limit
        allowed = np.clip(command, -arm.velocity_limit, arm.velocity_limit)
        change = scenario.dt * arm.acceleration_limit
        driven, before = np.clip(allowed, qdot - change, qdot + change), q
        q = np.clip(before + scenario.dt * driven, arm.lower, arm.upper)
        qdot = np.where(q == before + scenario.dt * driven, driven, (q - before) / scenario.dt)
        lost = np.abs([driven - qdot, command - allowed, allowed - driven]) > 1e-6 * scenario.velocity_limit
        coordinates = scenario.task.coordinates(*scenario.arm.forward(q))
        error = scenario.task.error(nominal[k + 1], coordinates)
        yield (
            {
                "q": q,
                "qdot": qdot,
                "pose": coordinates,
                "nominal": nominal[k + 2 : k + 4],
                "remaining": [scenario.steps - k - 1],
            },
            scenario.cost.tracking(error),
            scenario.cost.velocity(qdot),
            error,
            lost.sum(axis=1).tolist(),
        )


AXIS = ikgym.scenarios.get("zhang6-lspb").replace(name="zhang6-axis", task=ikgym.tasks.get("axis"))
STEPPED = [  # what other plants do is in tests/plant
    *(
        one
        for one in every_scenario(ikgym.scenarios.get)
        if one.values[0].iterations_per_point == (1,) and one.values[0].plant.ideal
    ),
    pytest.param(AXIS, id=AXIS.name),
    pytest.param(limited(steps=200), id="limited"),
]


@pytest.mark.parametrize("scenario", STEPPED)
def test_steps_are_what_the_specification_says(scenario):
    scenario = scenario.replace(steps=200 if scenario.name == "limited7-random" else 12)
    env = make(scenario)
    env.reset(seed=21)
    actions = np.random.default_rng(3).uniform(-1.1, 1.1, (scenario.steps, scenario.joints)).astype(np.float32)
    held = np.zeros(3)
    for k, (observation, tracking, velocity, error, at_limit) in enumerate(by_hand(scenario, actions, 21)):
        got, reward, terminated, truncated, info = env.step(actions[k])
        for key, value in observation.items():
            np.testing.assert_allclose(got[key], value, rtol=1e-13, atol=1e-13, err_msg=key)
        assert info["tracking_cost"] == pytest.approx(tracking, rel=1e-9)
        assert info["velocity_cost"] == pytest.approx(velocity, rel=1e-12)
        assert reward == -(info["tracking_cost"] + info["velocity_cost"])
        assert info["clipped"] is bool((np.abs(actions[k]) > 1).any())
        assert info["time"] == pytest.approx((k + 1) * scenario.dt)
        position = error[:3] if scenario.task.name in ("pose", "axis") else error[-3:]
        assert info["position_error"] == pytest.approx(np.linalg.norm(position), rel=1e-9)
        if scenario.task.name in ("pose", "axis"):  # the angle between orientations, or between axes
            assert info["orientation_error"] == pytest.approx(np.linalg.norm(error[3:]), rel=1e-9)
        held += info["at_limit"]
        assert info["at_limit"].tolist() == at_limit
        assert not terminated
        assert truncated is (k == scenario.steps - 1)
    assert scenario.name != "limited7-random" or (held > 0).all()


def test_held_points_count_once():
    """Nominal points 1, 2, 3 are held for 3, 2 and 2 steps."""
    scenario = ikgym.scenarios.get("khan8-q1").replace(iterations_per_point=(3, 2), steps=7)
    plain = scenario.replace(iterations_per_point=(1,)).nominal(preview=9)
    env = make(scenario, preview=3)
    observation, _ = env.reset(seed=0)
    points = [0, 1, 1, 1, 2, 2, 3, 3, 4, 4, 5]
    for k in range(8):
        np.testing.assert_array_equal(observation["nominal"], plain[points[k + 1 : k + 4]])
        if k == 7:
            break
        action = np.full(8, 0.01, dtype=np.float32)
        observation, reward, *_, info = env.step(action)
        last_of_its_point = k + 1 in (3, 5, 7)
        assert (reward != 0.0) is last_of_its_point
        assert (info["tracking_cost"] > 0) is (info["velocity_cost"] > 0) is last_of_its_point
        assert info["position_error"] > 0


def test_khan_moves_and_measures_the_exact_arm_and_maps_nominals_through_the_model():
    scenario = ikgym.scenarios.get("khan8-q1")
    env = make(scenario)
    observation, _ = env.reset()
    exact, approximate = ikgym.arms.get("khan8"), ikgym.arms.get("khan8_approximate")
    q = observation["q"]
    np.testing.assert_array_equal(observation["pose"], scenario.task.coordinates(*exact.forward(q)))
    first = scenario.task.coordinates(*approximate.forward([0.5 * np.sin(1e-3), 0, 0, 0, 0, 0, 0, 0]))
    np.testing.assert_allclose(observation["nominal"][0], first, atol=1e-14)


def test_zhang_helix_measures_zero_at_the_start_only():
    env = make("zhang3-helix")
    observation, _ = env.reset()
    np.testing.assert_array_equal(observation["pose"], 0.0)
    np.testing.assert_allclose(observation["nominal"][0], [4 + 3 * np.sin(np.pi / 25), 3 * np.cos(np.pi / 25), 5.01])
    observation, *_, info = env.step(np.zeros(3, dtype=np.float32))
    np.testing.assert_allclose(observation["pose"], [0, 0, 19], atol=1e-12)
    assert "orientation_error" not in info


def test_orientation_error_is_the_geodesic_angle_beyond_a_right_angle():
    """The skew part cannot tell θ from π - θ; the angle reported can."""
    env = make("varga7-fast")
    env.reset(options={"q": [0, 0, 0, 2.5, 0, 0, 0]})
    *_, info = env.step(np.zeros(7, dtype=np.float32))
    assert info["orientation_error"] == pytest.approx(2.5, abs=0.05)


@pytest.mark.parametrize("seed", [0, 7])
def test_seeds(seed):
    a, b = (make("varga7-random").unwrapped for _ in range(2))
    first = a.reset(seed=seed)
    assert identical(first, b.reset(seed=seed))
    assert not identical(first, b.reset(seed=seed + 1))
    np.testing.assert_array_equal(first[0]["nominal"], a.scenario.nominal(seed, 2)[1:3])
    # Without a seed the generator continues: another episode, but the same one in both.
    b.reset(seed=seed)
    second = a.reset()
    assert not identical(first, second)
    assert identical(second, b.reset())


def test_global_random_state_is_left_alone():
    before = np.random.get_state()[1].copy()  # noqa: NPY002  # the legacy state is what must not change
    env = make("varga7-random")
    env.reset(seed=1)
    env.step(np.zeros(7, dtype=np.float32))
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002


def test_ids_and_arguments():
    assert gym.make("ikgym:RedundantIK-v0").unwrapped.scenario.name == "varga7-fast"
    assert gym.make_vec("ikgym:RedundantIK-v0", num_envs=2).num_envs == 2
    observation, _ = make(preview=(1, 10, 40, 120)).reset()
    full = ikgym.scenarios.get("varga7-fast").nominal(preview=120)
    np.testing.assert_array_equal(observation["nominal"], full[[1, 10, 40, 120]])


def test_clipping_is_said_and_done():
    env = make()
    env.reset()
    observation, *_, info = env.step(np.array([1.5, -3, 0.5, 0, 0, 0, 0], dtype=np.float32))
    assert info["clipped"] is True
    np.testing.assert_array_equal(observation["qdot"], [20, -20, 10, 0, 0, 0, 0])


def test_step_needs_an_episode():
    env = make(ikgym.scenarios.get("varga7-fast").replace(steps=1)).unwrapped
    action = np.zeros(7, dtype=np.float32)
    with pytest.raises(ResetNeededError, match="call reset"):
        env.step(action)
    env.reset()
    assert env.step(action)[3] is True
    with pytest.raises(ResetNeededError, match="ended after 1 steps"):
        env.step(action)
    env.reset()
    env.step(action)
