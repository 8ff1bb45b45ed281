"""The simulator: nominal frames in blocks, memory, copies, and arrays that share nothing."""

import copy
import dataclasses
import functools
import itertools
import pickle
import typing

import numpy as np
import pytest
from gymnasium.utils import seeding

import ikgym
import ikgym.simulator as simulator_module
from ikgym.kernels import threads
from ikgym.simulator import Simulator
from ikgym.trajectories import Helix, RandomSinusoid, Trajectory
from tests.comparison import identical
from tests.limited import limited
from tests.plant.effects import ALL, panda

ROWS = 9


@dataclasses.dataclass(frozen=True, eq=False)
class Wanderer(Trajectory):
    """A user's random trajectory: of another kind each time, and without orientation."""

    random: typing.ClassVar[bool] = True
    has_orientation: typing.ClassVar[bool] = False

    def sample(self, rng):
        return Helix(rng.uniform(-1, 1, 3), 1.0, 2.0, 0.1)

    def frames(self, times, model):
        raise NotImplementedError


@dataclasses.dataclass(frozen=True, eq=False)
class Bent(RandomSinusoid):
    """Draws what needs each row computed by itself."""

    def sample(self, rng):
        return dataclasses.replace(super().sample(rng), sigmoid=float(rng.uniform(0.1, 0.4)), offset=0.3)


DRAWN = ikgym.scenarios.get("varga7-random").replace(steps=60)
WANDERER = ikgym.scenarios.get("zhang3-helix").replace(trajectory=Wanderer(), initial_pose=None, steps=60)
RANDOM = {
    "sinusoids": DRAWN,
    "held": DRAWN.replace(iterations_per_point=(3, 2)),
    "bent": DRAWN.replace(trajectory=Bent(DRAWN.trajectory.amplitude)),
    "wanderer": WANDERER,
    "splines-held": ikgym.scenarios.get("panda-payload").replace(steps=60, iterations_per_point=(3, 2)),
}


@pytest.mark.parametrize("preview", [1, (2, 13), (1, 200)])
@pytest.mark.parametrize("name", RANDOM)
def test_what_is_shown_ahead_is_the_nominal_of_each_rows_episode(name, preview):
    """Rows begin new episodes at different times, or enter them later."""
    scenario, seeds = RANDOM[name], np.arange(ROWS)
    simulator, rng = Simulator(scenario, ROWS, preview), np.random.default_rng(4)
    begun = np.ones(ROWS, dtype=bool)
    for _ in range(100):
        seeds[begun] += 100
        simulator.reset(begun, [seeding.np_random(int(seed))[0] for seed in seeds])
        out = simulator.step(rng.uniform(-0.1, 0.1, (ROWS, scenario.joints)))
        for row in range(0, ROWS, 4):
            nominal = scenario.nominal(int(seeds[row]), simulator.preview)
            ahead = simulator.steps_made[row] + np.array(simulator.preview)
            np.testing.assert_array_equal(out.nominal[row], nominal[ahead])
        begun = (simulator.steps_made == scenario.steps) | (rng.random(ROWS) < 0.02)


@pytest.mark.parametrize("name", ["panda-random", "varga7-random"])
def test_episodes_begin_with_the_frames_that_are_shown_alone(name):
    """The others are computed in the steps that need them: most episodes of an agent that explores are short."""
    simulator = Simulator(ikgym.scenarios.get(name), 2, (10, 40, 100))
    generators = [np.random.default_rng(i) for i in range(2)]
    simulator.reset(np.ones(2, dtype=bool), generators)
    simulator.observe()
    frames = simulator._state.frames
    assert [np.flatnonzero(row).tolist() for row in frames.any(axis=2)] == 2 * [[0, 10, 40, 100]]
    before = frames.copy()
    simulator.step(np.zeros((2, 7)))
    changed = (frames != before).any(axis=2)
    assert [np.flatnonzero(row).tolist() for row in changed] == 2 * [[1, 11, 41, 101]]


def test_threads_do_not_disturb_each_other(monkeypatch):
    """All rows of a step in several threads against one."""
    monkeypatch.setattr(threads, "count_cores", lambda: 4)
    rows, outcomes = 400, {}
    actions = np.random.default_rng(0).uniform(-1, 1, (5, rows, 7))
    for grain in (100, rows):
        monkeypatch.setattr(simulator_module, "GRAIN_STEP", grain)
        simulator = Simulator(ikgym.scenarios.get("varga7-random"), rows, 2)
        simulator.reset(np.ones(rows, dtype=bool), [np.random.default_rng(i) for i in range(rows)])
        outcomes[grain] = [simulator.step(a).numbers for a in actions]
    assert identical(outcomes[100], outcomes[rows])


@pytest.mark.parametrize("name", ["varga7-fast", "varga7-random", "varga7-random-long", "panda-random"])
def test_many_arms_take_little_memory(name):
    """All arrays of a simulator of 16,384 arms, and one outcome."""
    simulator = Simulator(ikgym.scenarios.get(name), 16_384, 2)
    taken = sum(array.nbytes for array in (*simulator._state, *simulator._shared) if isinstance(array, np.ndarray))
    assert taken + simulator.observe().numbers.nbytes < 100e6


ENVS = [
    functools.partial(make, scenario=scenario)
    for make in (ikgym.RedundantIKEnv, functools.partial(ikgym.RedundantIKVectorEnv, 3))
    for scenario in ("varga7-random", "panda-random", limited(), panda(ALL))
]
TASK = ikgym.rl.Task("learning-camera", history=2, commands=2)
LEARNERS = [functools.partial(ikgym.rl.LearningEnv, TASK), functools.partial(ikgym.rl.LearningVectorEnv, 3, TASK)]


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
@pytest.mark.parametrize("make", [*ENVS, *LEARNERS])
def test_copies_go_on_by_themselves(make, duplicate):
    """A copy whose kernel still saw the arrays of the first would step it instead."""
    env, twin = make(), make()
    actions = np.full(env.action_space.shape, 0.2, dtype=np.float32)
    for e in (env, twin):
        e.reset(seed=3)
        e.step(actions)
    copied = duplicate(env)
    got = [copied.step(k * actions) for k in (1, 2, 3)]
    wanted = [twin.step(k * actions) for k in (1, 2, 3)]
    assert identical(got, wanted)
    assert identical(env.step(actions), wanted[0])


@pytest.mark.parametrize("make", ENVS)
def test_what_goes_out_shares_no_memory(make):
    env = make()
    actions = np.full(env.action_space.shape, 0.2, dtype=np.float64)
    seen = [*env.reset(seed=0)[0].values()]
    for _ in range(2):
        observation, _, _, _, info = env.step(actions)
        seen += [*observation.values(), *(value for value in info.values() if isinstance(value, np.ndarray))]
    inside = [array for array in (*env._simulator._state, *env._simulator._shared) if isinstance(array, np.ndarray)]
    for a, b in itertools.chain(itertools.combinations(seen, 2), itertools.product(seen, [*inside, actions])):
        assert not np.shares_memory(a, b)
    assert all(array.flags.c_contiguous and array.flags.writeable for array in seen)
