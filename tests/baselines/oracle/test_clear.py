"""Best known costs among bodies: certified clear by the plant, and of another episode than those without bodies."""

import numpy as np
import pytest

import ikgym
from baselines.fingerprints import episode_hash, fingerprint
from baselines.oracle import Search, solve
from baselines.oracle.episode import EpisodeProblem
from baselines.oracle.search import polish
from tests.bodied import ball_in_the_way

SEED, STEPS = 3, 100
QUICK = Search(starts=6, generations=1, chains=2, rounds=2, polished=2, knots=20)
FREE = ikgym.scenarios.get("panda-random").replace(steps=STEPS)


@pytest.fixture(scope="module")
def free():
    return solve(FREE, SEED, QUICK, cached=False)


@pytest.fixture(scope="module")
def ball(free):
    return ball_in_the_way(FREE.arm, free.q)


def test_the_best_path_is_clear_and_costs_more(free, ball):
    scenario = FREE.replace(obstacles=[ball])
    best = solve(scenario, SEED, QUICK, cached=False)
    assert FREE.arm.clearance(best.q, [ball])[0].min() > 5e-5
    assert free.cost < best.cost < 1.5 * free.cost
    q, cost = EpisodeProblem.of(scenario, SEED).play(best.qdot)
    assert cost == best.cost
    np.testing.assert_array_equal(q, best.q)


def test_a_path_that_touches_costs_without_end(free, ball):
    scenario = FREE.replace(obstacles=[ball])
    assert EpisodeProblem.of(scenario, SEED).play(free.qdot)[1] == np.inf
    found = polish(scenario, SEED, {"free": free.q})
    assert found.cost > free.cost
    assert FREE.arm.clearance(found.q, [ball])[0].min() > 0.0


def test_given_paths_replace_horizons_and_roll_out(free, ball):
    scenario = FREE.replace(obstacles=[ball])
    found = solve(scenario, SEED, QUICK, paths={"free": free.q})
    kinds = {one.kind for one in found.starts}
    assert "free" in kinds
    assert "roll-out" not in kinds
    assert not any(kind.startswith("rhc") for kind in kinds)
    assert found.cost < 1.5 * free.cost


def test_records_among_bodies_are_their_own(ball):
    scenario = FREE.replace(obstacles=[ball])
    moved = FREE.replace(obstacles=[ball.replace(radius=0.051)])
    blind = scenario.replace(collisions=False)
    assert len({fingerprint(one) for one in (FREE, scenario, moved)}) == 3
    assert fingerprint(blind) == fingerprint(FREE)
    other = scenario.replace(arm=FREE.arm.replace(bodies=FREE.arm.bodies.replace(radii=1.01 * FREE.arm.bodies.radii)))
    assert episode_hash(other, SEED) != episode_hash(scenario, SEED)
    assert episode_hash(other.replace(obstacles=[]), SEED) == episode_hash(FREE, SEED)
