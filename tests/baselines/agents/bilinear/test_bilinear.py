"""The bilinear agent: its features and its law."""

import numpy as np
import pytest

import baselines
from baselines.agents.bilinear.features import feature_rows
from baselines.agents.bilinear.kernels import action_rows
from baselines.agents.bilinear.processing import Bilinear
from baselines.episodes import rollouts
from baselines.policy import Batch, Problem
from ikgym import arms, scenarios, tasks
from tests.baselines.random_agents import write_agent

OFFSETS = (1, 5, 20)
ROWS = 6


def problem_of(arm="varga7", task="pose"):
    problem = Problem.of(scenarios.get("varga7-random"))
    arm = arms.get(arm)
    return problem.replace(model=arm, task=tasks.get(task), velocity_limit=np.linspace(1.0, 2.0, arm.joints))


def batch_of(problem, seed=0, turned=0.0):
    """Arms somewhere, and references near them; all of it turned about the axis of joint 1."""
    rng, arm, task = np.random.default_rng(seed), problem.model, problem.task
    q = rng.uniform(-1.0, 1.0, (ROWS, arm.joints))
    way = q[:, None] + rng.normal(scale=0.05, size=(ROWS, len(OFFSETS), arm.joints))
    q[:, 0] += turned
    way[:, :, 0] += turned
    pose, nominal = task.coordinates(*arm.forward(q)), task.coordinates(*arm.forward(way))
    return Batch(q, np.zeros_like(q), pose, nominal, rng.uniform(0.0, 900.0, (ROWS, 1)))


def features(problem, batch, speed=None):
    """The features of the network, in single precision as it sees them."""
    out = np.empty((len(batch.q), Bilinear(OFFSETS).size(problem)), np.float32)
    speed = np.empty(len(batch.q)) if speed is None else speed
    arrays = batch.q, batch.nominal, batch.remaining, out, speed
    feature_rows(problem.task.kind, problem.model.chain, problem.dt, np.array(OFFSETS), *arrays)
    return out


def outputs(problem, seed=1):
    """G and h."""
    size = ROWS, Bilinear(OFFSETS).held_size(problem)
    return np.random.default_rng(seed).normal(size=size).astype(np.float32)


def qdot(problem, batch, output):
    """The joint velocities of (G, h)."""
    out, scene = np.empty(batch.q.shape), (problem.task.kind, problem.model.chain, problem.dt, np.array(OFFSETS))
    action_rows(scene, problem.velocity_limit, batch.q, batch.pose, batch.nominal, output, out)
    return out * problem.velocity_limit


@pytest.mark.parametrize("task", ["position", "matrix", "pose", "axis"])
def test_a_turn_of_joint_1_changes_nothing(task):
    problem = problem_of(task=task)
    here, there = batch_of(problem), batch_of(problem, turned=0.8)
    np.testing.assert_allclose(features(problem, here), features(problem, there), rtol=2e-5, atol=2e-5)
    output = outputs(problem)
    np.testing.assert_allclose(qdot(problem, there, output), qdot(problem, here, output), rtol=1e-9, atol=1e-9)


def test_a_prismatic_joint_1_is_seen():
    """Nothing is turned with it."""
    problem = problem_of("tiago")
    here, there = batch_of(problem), batch_of(problem, turned=0.8)
    assert np.abs(features(problem, there)[:, :2] - features(problem, here)[:, :2]).max() > 0.1


def test_features_in_numbers():
    """Against the table of the docstring, where twists are plain differences."""
    problem = problem_of(task="position")
    batch = batch_of(problem)
    mean = np.diff(batch.nominal, axis=1) / (np.diff(OFFSETS)[None, :, None] * problem.dt)
    speed = 0.02 + np.sqrt((mean**2).mean((1, 2)))
    angle = -batch.q[:, 0]  # about z
    turn = np.array([[np.cos(angle), -np.sin(angle), 0 * angle], [np.sin(angle), np.cos(angle), 0 * angle]])
    x, y = (np.einsum("jr,rij->ri", part, mean) for part in turn)
    ahead = np.stack([x, y, mean[:, :, 2]], 2) / speed[:, None, None]
    joints = [np.sin(batch.q[:, 1]), np.cos(batch.q[:, 1]), batch.q[:, 2]]
    rest = [part(batch.q[:, j]) for j in range(3, 7) for part in (np.sin, np.cos)]
    left = np.minimum(batch.remaining[:, 0] / 500.0, 1.0)
    wanted = np.concatenate(
        [np.stack(joints + rest, 1), ahead.reshape(ROWS, -1), np.stack([np.log(speed), left], 1)], 1
    )
    np.testing.assert_allclose(features(problem, batch)[:, : wanted.shape[1]], wanted, rtol=1e-6, atol=1e-6)
    output = outputs(problem)
    law = output.reshape(ROWS, 7, 4).astype(float)
    due = (batch.nominal[:, 0] - batch.pose) / problem.dt
    due = np.stack([*(np.einsum("jr,rj->r", part, due) for part in turn), due[:, 2]], 1)
    given = np.einsum("rja,ra->rj", law[:, :, :3], due) + law[:, :, 3] * speed[:, None]
    np.testing.assert_allclose(qdot(problem, batch, output), given, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("task", ["position", "matrix", "pose", "axis"])
def test_the_inverse_jacobian_removes_the_error(task):
    """With G J = I in the frame of joint 1 and h = 0, one step of a small error leaves next to nothing of it."""
    problem = problem_of("puma560" if task != "position" else "zhang3", task)
    arm, batch = problem.model, batch_of(problem)
    near = batch.q + np.random.default_rng(2).normal(scale=1e-4, size=batch.q.shape)
    target = problem.task.coordinates(*arm.forward(near))
    batch = batch._replace(nominal=np.stack([target] * 3, 1))
    c, s = np.cos(batch.q[:, 0]), np.sin(batch.q[:, 0])
    jacobian = arm.jacobian(batch.q)[:, : Bilinear(OFFSETS).held_size(problem) // arm.joints - 1]
    axis, zero = arm.chain.axes[0], np.zeros(ROWS)
    assert axis.tolist() == [0.0, 0.0, 1.0]
    back = np.moveaxis(np.array([[c, s, zero], [-s, c, zero], [zero, zero, zero + 1.0]]), 2, 0)
    turned = np.concatenate([back @ jacobian[:, i : i + 3] for i in range(0, jacobian.shape[1], 3)], 1)
    law = np.concatenate([np.linalg.pinv(turned, rcond=1e-6), np.zeros((ROWS, arm.joints, 1))], 2)
    moved = batch.q + problem.dt * qdot(problem, batch, law.reshape(ROWS, -1).astype(np.float64))
    after = problem.task.error(target, problem.task.coordinates(*arm.forward(moved)))
    before = problem.task.error(target, batch.pose)
    assert np.abs(after).max() < 0.02 * np.abs(before).max()


def test_agents_play_alike_where_skew_coordinates_are_shown(tmp_path):
    scenario, skew = (scenarios.get(name).replace(steps=20) for name in ("varga7-pose-random", "varga7-random"))
    file = write_agent(tmp_path / "a.safetensors", scenario, processing=Bilinear(OFFSETS))
    (episode,), (shown,) = (rollouts(on, baselines.make("agent", on, path=file), [3]) for on in (scenario, skew))
    np.testing.assert_allclose(shown.qdot, episode.qdot, rtol=1e-3, atol=1e-5)
