"""Episodes of one arm in a row, with a policy whose state is handed on, and episodes with other noise."""

import dataclasses
from typing import ClassVar

import numpy as np
import pytest

import ikgym
from baselines.episodes import Seeds, rollout, rollouts
from baselines.evaluate import evaluate
from baselines.evaluation.run import batches, play
from baselines.policy import Solution, SolverPolicy, statuses
from ikgym import Plant
from ikgym.exceptions import InvalidInputError
from tests.baselines.evaluation.planning import planned
from tests.comparison import identical

STEPS = 12
SAME_ARM = ikgym.scenarios.get("panda-same-arm").replace(steps=STEPS)


@dataclasses.dataclass(frozen=True, eq=False)
class Counting(SolverPolicy):
    """Goes the slower the more episodes it has begun; what it counts survives their beginnings."""

    name: ClassVar[str] = "counting"

    def memory(self, rows):
        return (np.zeros(rows),)

    def begin_episodes(self, memory, rows):
        return (memory[0] + rows,)

    def solve(self, batch, memory):
        qdot = 1e-3 * (batch.q + batch.pose[:, -1:]) / (1.0 + memory[0][:, None])
        return Solution(qdot, memory, statuses(len(qdot)), np.zeros(len(qdot), dtype=np.int64))


@pytest.mark.parametrize("timed", [True, False])
def test_the_state_is_handed_on(timed):
    draws = [Seeds(seed, 0) for seed in range(3)]
    policy = Counting.for_scenario(SAME_ARM)
    first, second, third = rollouts(SAME_ARM, policy, draws, timed=timed, in_a_row=3)
    assert identical(first.q, rollout(SAME_ARM, policy, draws[0], timed=False).q)
    for episode, draw, times in ((second, draws[1], 2.0), (third, draws[2], 3.0)):
        fresh = rollout(SAME_ARM, policy, draw, timed=False)
        np.testing.assert_allclose(episode.qdot[0] * times, fresh.qdot[0], rtol=1e-5)


def jobs_of(episodes=7, **options):
    return planned(SAME_ARM, Counting, episodes=episodes, **options).jobs


def test_five_episodes_have_one_arm():
    jobs = jobs_of()
    assert [job.seeds.arm_seed for job in jobs] == [400_000] * 5 + [400_001] * 2
    assert [job.before for job in jobs] == [0, 1, 2, 3, 4, 0, 1]
    frozen = planned((), "dls", test_sets="panda-same-arm").jobs
    assert (len(frozen), len({job.seeds.arm_seed for job in frozen})) == (65 * 3, 13)


def test_all_ways_to_play_them_are_the_same():
    jobs = [dataclasses.replace(job, timed=False) for job in jobs_of(noise_seeds=2)]
    (together,) = batches(jobs)
    whole = {row.key: row.total_cost for row, _ in play(together)}
    assert len(set(whole.values())) == len(jobs) == 14
    by_itself = [play((job,))[0][0] for job in (jobs[9], jobs[13])]
    timed = [play((dataclasses.replace(job, timed=True),))[0][0] for job in (jobs[9], jobs[0])]
    for one in (*by_itself, *timed):
        assert one.total_cost == whole[one.key]
    assert timed[0].time_p50_us is not None


def test_a_reference_is_told_its_arm():
    (first, second, *_) = planned(SAME_ARM, "told:policy=qp", episodes=2).jobs
    assert second.arguments["arm_seed"] == 400_000
    assert second.before == 0
    assert first.parameters == second.parameters
    assert second.bind().drawn.arm.offsets[0, 0] == SAME_ARM.drawn_plant(arm_seed=400_000).arm.offsets[0, 0]


def test_other_noise_on_the_same_path_with_the_same_arm():
    scenario = SAME_ARM.replace(name="noisy", plant=Plant(zero=5e-4, q_noise=1e-4))
    rows = evaluate(scenario, "rhc:horizon=3", episodes=2, noise_seeds=3)
    assert [(row.seed, row.noise_seed) for row in rows] == [(2_000_000 + k // 3, k % 3) for k in range(6)]
    assert len({row.total_cost for row in rows}) == 6
    one, other = (scenario.drawn_plant(2_000_000).arm.chain for _ in range(2))
    assert identical(one.offsets, other.offsets)
    once = evaluate(scenario.replace(plant=Plant(zero=5e-4)), "rhc:horizon=3", episodes=2, noise_seeds=3)
    assert len(once) == 2


def test_wrapped_environments_play_no_sequences():
    job = jobs_of(2)[1]

    class Agent:
        def predict(self, observation, state=None, episode_start=None, deterministic=False):
            return np.zeros(7, dtype=np.float32), state

    wrapped = planned(SAME_ARM, Agent(), episodes=2, preview=1, wrap=lambda env: env).jobs[1]
    assert wrapped.before == job.before
    with pytest.raises(InvalidInputError, match="sequences of episodes are played without wrappers"):
        play([wrapped])
