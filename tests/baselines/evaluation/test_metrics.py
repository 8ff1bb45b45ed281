import dataclasses
import json
import math

import gymnasium as gym
import numpy as np
import pytest
from numpy.testing import assert_allclose

import baselines
import ikgym
from baselines.episodes import Episode, Seeds, rollout
from baselines.evaluate import evaluate
from baselines.evaluation.metrics import TIME_COLUMNS, Row, is_followed, lost, measure
from baselines.evaluation.summary import summarise
from baselines.files import from_json
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from tests.limited import limited

MACHINE = {"cpu": "a", "ikgym": "0"}


def scenario(name="varga7-fast", **changes):
    return ikgym.scenarios.get(name).replace(**changes)


def row_of(which, episode, **changes):
    fields = {"parameters": {}, "machine": MACHINE, "preview": 1, "fingerprint": "f", **changes}
    return measure(which, "dls", episode=episode, **fields)


def restored(values):
    return from_json(Row, Row.nan_restored(values))


def handmade(steps=4, **changes):
    arrays = dict.fromkeys(("q", "qdot", "pose", "at_limit"), np.zeros((steps, 3)))
    arrays |= dict.fromkeys(("tracking_cost", "velocity_cost", "position_error"), np.zeros(steps))
    arrays |= {"orientation_error": np.full(steps, np.nan), "status": np.zeros(steps, dtype=np.int64)}
    arrays |= {"iterations": np.ones(steps, dtype=np.int64), "time_ns": np.full(steps, 1000, dtype=np.int64)}
    arrays |= {"scenario": position_scenario(steps), "seeds": Seeds(0), "diagnostics": {}}
    return Episode(**arrays | {name: np.asarray(values) for name, values in changes.items()})


def position_scenario(steps=4, **changes):
    return scenario("zhang3-helix", steps=steps, **changes)


@pytest.mark.parametrize(
    ("name", "steps", "seed", "policy"),
    [("varga7-random", 60, 2_000_001, "moore_penrose"), ("khan8-q7q8", 150, 0, "dls")],
)
def test_total_cost_is_the_sum_of_the_rewards_of_gymnasium_bit_for_bit(name, steps, seed, policy):
    which = scenario(name, steps=steps)
    solver = baselines.make(policy, which)
    env = gym.make("RedundantIK-v0", scenario=which, preview=solver.preview)
    observation, _ = env.reset(seed=seed)
    total, state, ended = 0.0, None, False
    while not ended:
        action, state = solver.predict(observation, state)
        observation, reward, _, ended, _ = env.step(action)
        total -= float(reward)
    assert row_of(which, rollout(which, solver, seed)).total_cost == total


class Pushing:
    """A policy that pushes all joints to and fro."""

    preview = 1
    commands = 0

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.full(7, 1.0 if observation["remaining"][0] % 14 < 7 else -0.9, dtype=np.float32), state


def test_limits_are_in_the_row():
    which = limited(steps=40)
    (row,) = evaluate(which, Pushing())
    env = gym.make("RedundantIK-v0", scenario=which, preview=1)
    seen, _ = env.reset(seed=row.seed)
    at, margin, last, change = np.zeros(3, dtype=int), np.inf, np.zeros(7), 0.0
    for _ in range(40):
        seen, *_ = env.step(Pushing().predict(seen)[0])
        arm, qddot = which.arm, (seen["qdot"] - last) / which.dt
        stops = np.minimum(seen["q"] - arm.lower, arm.upper - seen["q"]) <= 0.0
        fast, hard = np.abs(seen["qdot"]) >= arm.velocity_limit, np.abs(qddot) >= (1.0 - 1e-9) * arm.acceleration_limit
        at += [stops.any(), fast.any(), hard.any()]
        margin = min(margin, (seen["q"] - which.arm.lower).min(), (which.arm.upper - seen["q"]).min())
        change, last = max(change, np.abs(seen["qdot"] - last).max()), seen["qdot"]
    assert (at > 0).all()
    assert [row.steps_at_joint_limit, row.steps_at_velocity_limit, row.steps_at_acceleration_limit] == at.tolist()
    assert row.joint_limit_margin_min == margin == 0.0
    assert row.qddot_peak == pytest.approx(change / which.dt)


HELD = scenario("faitli3-regular", iterations_per_point=(2,), steps=6)


@pytest.mark.parametrize(
    ("which", "points", "counted"),
    [(scenario(steps=80), np.arange(1, 81), slice(None)), (HELD, np.array([1, 2, 3]), [1, 3, 5])],
    ids=["each step counts", "of each held point the last step counts"],
)
def test_metrics_equal_a_plain_numpy_computation(which, points, counted):
    """From the joint velocities alone, with the public objects and eq. 5."""
    episode = rollout(which, baselines.make("dls", which, gain=0.5), 0)
    row, joints = row_of(which, episode), which.trajectory.joint_path
    q = joints(np.zeros(1))[0] + np.cumsum(which.dt * episode.qdot, axis=0)
    assert_allclose(episode.q, q, rtol=0, atol=1e-13)
    actual, nominal = which.arm.forward(q[counted]), which.model.forward(joints(points * which.dt))
    distance = np.linalg.norm(nominal[1] - actual[1], axis=1)
    tracking = which.cost.tracking(
        which.task.error(which.task.coordinates(*nominal), which.task.coordinates(*actual))
    ).sum()
    velocity = which.cost.velocity(episode.qdot[counted]).sum()
    expected = {
        "tracking_cost": tracking, "velocity_cost": velocity, "total_cost": tracking + velocity,
        "position_error_max": distance.max(), "position_error_rms": math.sqrt((distance**2).mean()),
        # Of the joint velocities all steps count.
        "qdot_peak": np.abs(episode.qdot).max(), "qdot_rms": math.sqrt((episode.qdot**2).mean()),
        "qdot_total_variation": np.abs(np.diff(episode.qdot, axis=0)).sum(),
    }  # fmt: skip
    assert {name: getattr(row, name) for name in expected} == pytest.approx(expected, rel=1e-9)
    if which.task.has_orientation:
        angle = np.arccos(np.clip((np.einsum("kij,kij->k", nominal[0], actual[0]) - 1) / 2, -1, 1))
        assert_allclose(row.orientation_error_max, angle.max(), rtol=1e-5)
        assert_allclose(row.orientation_error_rms, math.sqrt((angle**2).mean()), rtol=1e-5)
    assert (row.scenario, row.policy, row.seed, row.steps) == (which.name, "dls", 0, which.steps)


def test_numbers_of_a_handmade_episode():
    times = [1_000, 2_000, 3_000, 1_000_000_001]  # Δt is 1 s
    status = [Status.CONVERGED, Status.DIVERGED, Status.CONVERGED, Status.ITERATION_LIMIT]
    qdot = [[1.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [-2.0, 0.5, 0.0], [0.0, 0.5, 0.0]]
    costs = {"tracking_cost": [1.0, 2.0, 3.0, 4.0], "velocity_cost": [0.5] * 4}
    others = {"iterations": [1, 2, 3, 6], "position_error": [0.0, 3.0, 4.0, 0.0]}
    row = row_of(position_scenario(), handmade(qdot=qdot, time_ns=times, status=status, **costs, **others))
    expected = {
        "qdot_peak": 2.0, "qdot_rms": math.sqrt(9.5 / 12), "qdot_total_variation": 3.0 + 0.5 + 2.0,
        "time_first_us": 1.0, "time_p50_us": 3.0, "time_p99_us": np.percentile(times[1:], 99) / 1e3,
        "deadline_misses": 1, "solver_status": "diverged", "followed": False, "iterations": 3.0,
        "position_error_max": 4.0, "position_error_rms": 2.5,
        "total_cost": 12.0, "tracking_cost": 10.0, "velocity_cost": 2.0,
    }  # fmt: skip
    assert {name: getattr(row, name) for name in expected} == pytest.approx(expected)
    assert row.status_counts == {"converged": 2, "iteration_limit": 1, "diverged": 1}


def test_what_was_not_timed_has_no_times():
    row = row_of(position_scenario(), handmade(time_ns=np.empty(0, dtype=np.int64)))
    assert [getattr(row, name) for name in TIME_COLUMNS] == [None] * 4
    assert restored(json.loads(json.dumps(row.to_json()))) == row
    timed = dataclasses.replace(row_of(position_scenario(), handmade()), seed=1)
    names = ["time_p50_us", "time_p99_us", "deadline_misses"]
    assert summarise([row, timed]).loc[0, names].tolist() == [getattr(timed, name) for name in names]
    assert summarise([row])[names].isna().all(axis=None)


def test_a_row_survives_json():
    parameters = {"damping": 1e-3, "rule": "a", "weights": [1, 2]}
    row = row_of(position_scenario(), handmade(), parameters=parameters, test_set="0123456789ab")
    there = json.loads(json.dumps(row.to_json(), allow_nan=False))
    assert list(there) == [field.name for field in dataclasses.fields(Row)]
    assert restored(there) == row
    assert restored(there).key == row.key
    there = dataclasses.replace(row, total_cost=math.inf).to_json()
    assert there["total_cost"] is None
    assert math.isnan(restored(there).total_cost)


@pytest.mark.parametrize("change", [{"fingerprint": "g"}, {"test_set": "0123456789ab"}])
def test_rows_of_different_content_are_not_put_together(change):
    base = row_of(position_scenario(), handmade())
    other = dataclasses.replace(base, policy="moore_penrose", **change)
    with pytest.raises(InvalidInputError, match="results of 'zhang3-helix' cannot be put together"):
        summarise([base, other])
    assert len(summarise([base, dataclasses.replace(other, scenario="another")])) == 2


def test_followed_and_lost_by_position_or_orientation():
    """NaN is lost and not followed."""
    small, nan = (1e-3, 1e-3), math.nan
    assert all(is_followed(*errors) for errors in (small, (1e-3, None)))
    assert not any(is_followed(*errors) for errors in ((1.01e-3, None), (0.0, 1.01e-3), (nan, 0.0), (0.0, nan)))
    assert not lost(0.05, 0.3)
    assert all(lost(*errors) for errors in ((0.0, 0.301), (0.0501, None), (nan, 0.0), (0.0, nan)))
    rows = [row_of(position_scenario(), handmade(position_error=[0.0, 0.0, e, 0.0])) for e in (1e-3, 0.01, 0.06, nan)]
    assert [row.followed for row in rows] == [True, False, False, False]
    assert [row.lost for row in rows] == [False, False, True, True]
    assert summarise([dataclasses.replace(row, seed=seed) for seed, row in enumerate(rows)]).lost[0] == 2
