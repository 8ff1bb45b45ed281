"""Episodes that are played together are those that are played alone."""

import baselines
import ikgym
from baselines.episodes import rollout, rollouts
from baselines.status import Status
from tests.bodied import blocked
from tests.comparison import identical

SEEDS = [2_000_000, 2_000_001, 5]
STEPS = 25


def fields(episode):
    return {name: value for name, value in vars(episode).items() if name != "time_ns" and value is not None}


def assert_same(together, alone):
    assert len(alone.time_ns) == len(alone.q)
    assert len(together.time_ns) == 0
    for name, value in fields(together).items():
        assert identical(value, fields(alone)[name]), name


def test_points_that_are_held_and_a_longer_preview():
    scenario = ikgym.scenarios.get("khan8-q7q8").replace(steps=70, plant=ikgym.Plant(noise=0.1))
    policy = baselines.make("rhc_gradient", scenario)
    for seed, episode in zip(SEEDS, rollouts(scenario, policy, SEEDS, preview=5), strict=True):
        assert_same(episode, rollout(scenario, policy, seed, preview=5))


def test_collisions():
    scenario = blocked()
    policy = baselines.make("dls", scenario)
    together = rollouts(scenario, policy, [0, 1])
    assert_same(together[0], rollout(scenario, policy, 0))
    assert together[0].stopped.any()


def test_ticks_add_up_to_the_steps_of_all():
    for steps in (1, 250):
        scenario, ticks = ikgym.scenarios.get("varga7-random").replace(steps=steps), []
        rollouts(scenario, baselines.make("dls", scenario), SEEDS, tick=ticks.append)
        assert sum(ticks) == 3 * steps


def test_a_row_that_is_lost_does_not_touch_the_others():
    scenario = ikgym.scenarios.get("varga7-random").replace(steps=STEPS)
    wild = baselines.make("rhc_gradient", scenario, alpha_max=5e-2, alpha_min=1e-3)
    together = rollouts(scenario, wild, SEEDS)
    assert any(Status.DIVERGED in episode.status for episode in together)
    for seed, episode in zip(SEEDS, together, strict=True):
        assert_same(episode, rollout(scenario, wild, seed))
