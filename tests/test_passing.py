"""Random motion among bodies: at no tenth of a step is one inside of another.

Distances of pairs are compared with coal in tests/kernels/test_segments.py, the smallest of them in test_bodies.py.
"""

import gymnasium as gym
import numpy as np
import pytest

import ikgym
from ikgym.kernels.bodies import clearance_rows
from ikgym.obstacles.solids import closest
from tests.bodied import AROUND, PERSON, crowd

CROWD = crowd(1000, (*AROUND, PERSON))
NAMES = [*ikgym.scenarios.names("bodies"), CROWD.name]
#: Steps of all scenarios together; arms side by side; of each step so many are measured that are closest, if they
#: are nearer than a distance in [m].
MANY, ROWS, CLOSEST, NEAR = 1_000_000, 50, 4, 0.01


@pytest.mark.parametrize("name", NAMES)
def test_no_arm_passes_through_a_body(name):
    check(scenario_of(name), 1_000)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_no_arm_passes_through_a_body_in_many_steps(name):
    lowest, stops = check(scenario_of(name), MANY // len(NAMES))
    assert lowest < 1e-3
    assert stops > 0


def scenario_of(name):
    return CROWD if name == CROWD.name else ikgym.scenarios.get(name)


def check(scenario, count):
    """Moves arms for a number of steps; returns their lowest distance and how often one was stopped."""
    lowest, moved, stops, walk = np.inf, 0, 0, Walk(scenario)
    arm, checked = scenario.arm, scenario.surroundings.checked
    while moved < count:
        ways, places, clearances = walk.some_steps()
        moved, stops = moved + walk.moved, stops + walk.stopped.sum()
        distances = closest(arm, tenths(*ways), tenths(*places), checked).distances
        np.testing.assert_allclose(distances[-len(clearances) :], clearances, atol=1e-12)
        lowest = min(lowest, distances.min(initial=np.inf))
        walk.begin_again()
    assert lowest > 0.0
    return lowest, stops


def tenths(before, after):
    """What moves evenly, after each tenth of its step; the ends are last. Shapes (k, …) and (10 k, …)."""
    return np.concatenate([before + share * (after - before) for share in np.linspace(0.1, 1.0, 10)])


class Walk:
    """Random motion of arms, which begin again somewhere else when they are stopped.

    Args:
        scenario: A scenario with bodies.
    """

    def __init__(self, scenario):
        self.scenario, self.rng = scenario, np.random.default_rng(0)
        self.envs = gym.make_vec("RedundantIK-v0", num_envs=ROWS, scenario=scenario, autoreset_mode="Disabled")
        self.table = scenario.obstacle_rows(scenario.steps + 2)
        self.drift, self.made = np.empty((ROWS, scenario.joints)), np.empty(ROWS, dtype=np.int64)
        self.stopped, self.over = np.ones(ROWS, dtype=bool), False
        self.begin_again(seed=0)

    def begin_again(self, seed=None):
        """Begins the episodes of arms that are stopped, or whose episode is over."""
        mask = self.stopped | self.over
        if mask.any():
            options = {"reset_mask": mask} | ({} if self.scenario.random else {"q": self.starts()})
            self.seen, _ = self.envs.reset(seed=seed, options=options)
            self.drift[mask], self.made[mask] = self.rng.uniform(-1, 1, (mask.sum(), self.scenario.joints)), 0
            self.stopped &= False

    def starts(self):
        """Postures that touch nothing. Shape (ROWS, n)."""
        arm, around, count = self.scenario.arm, self.scenario.surroundings, 20 * ROWS
        q = self.rng.uniform(np.maximum(arm.lower, -3.0), np.minimum(arm.upper, 3.0), (count, arm.joints))
        distances, pairs = np.empty(count), np.empty((count, 2), dtype=np.int64)
        clearance_rows(arm.chain, arm.bodies.shapes, around.boxes, around.checked, q, distances, pairs)
        return q[distances > 1e-3][:ROWS]

    def some_steps(self, steps=20):
        """Joint coordinates and obstacles before and after the steps that come near something, and the clearances."""
        ways, places, clearances = [], [], []
        self.moved = 0
        for _ in range(steps):
            wild = np.clip(self.drift + 0.3 * self.rng.normal(size=self.drift.shape), -1, 1)
            before, around, stopped = self.seen["q"], self.around(), self.stopped
            self.seen, _, _, over, info = self.envs.step(wild.astype(np.float32))
            self.made, self.stopped, self.over = self.made + 1, info["collision"], over
            self.check_still(before, stopped)
            distances = np.where(self.stopped, np.inf, info["clearance"])
            near = np.argsort(distances)[:CLOSEST]
            near = near[distances[near] < NEAR]
            ways.append((before[near], self.seen["q"][near]))
            places.append((around[near], self.around()[near]))
            clearances.append(info["clearance"][near])
            self.moved += int((~self.stopped).sum())
            if over.any():
                break
        together = [tuple(map(np.concatenate, zip(*parts, strict=True))) for parts in (ways, places)]
        return *together, np.concatenate(clearances)

    def around(self):
        """The obstacles of all arms. Shape (ROWS, o, 16)."""
        if self.scenario.draws_obstacles:
            return self.seen["obstacles"]  # at rest
        return self.table[np.minimum(self.made, len(self.table) - 1)]

    def check_still(self, before, stopped):
        """An arm that is stopped stays where it was."""
        assert not (stopped & ~self.stopped).any()
        np.testing.assert_array_equal(self.seen["q"][self.stopped], before[self.stopped])
        assert not self.seen["qdot"][self.stopped].any()
