"""The 90° ambiguity of skew coordinates is resolved by how they came about: policies then track whole poses."""

import numpy as np
import pytest

import baselines
from baselines.episodes import rollouts
from baselines.policy import Batch, Problem
from baselines.solvers.wrappers.full_orientation import resolve_one, resolve_orientation, start_memory
from ikgym import scenarios, tasks
from ikgym.kernels.rotations import rodrigues

DLS = {"damping": 1e-2, "gain": 0.3}


def cosine(frames):
    return 0.5 * (frames[..., 0] + frames[..., 4] + frames[..., 8] - 1.0)


def with_poses(scenario):
    return scenario.replace(task=tasks.get("pose"))


@pytest.mark.parametrize("degrees", [0.0, 1e-6, 89.0, 91.0, 179.9])
def test_orientation_is_told_from_its_skew_part_and_its_side(degrees):
    rng = np.random.default_rng(round(degrees))
    axis = rng.normal(size=3)
    rotation = np.array(rodrigues(axis / np.linalg.norm(axis), np.radians(degrees)))
    position = rng.normal(size=3)
    out = np.empty(12)
    resolve_one(tasks.get("skew").coordinates(rotation, position), cosine(rotation.ravel()), out)
    # Close to 180° the axis is known as well as its sine is.
    np.testing.assert_allclose(out, [*rotation.ravel(), *position], atol=1e-14 if degrees < 150.0 else 1e-11)


def test_nominal_orientations_are_followed_through_90_degrees():
    scenario, ahead = scenarios.get("varga7-random"), 40
    problem, seeds = Problem.of(scenario), range(10)
    frames = np.stack([with_poses(scenario).nominal(seed, ahead) for seed in seeds])
    skews = np.stack([scenario.nominal(seed, ahead) for seed in seeds])
    q = np.stack([scenario.nominal_joint_path(seed)[0] for seed in seeds])
    kept = start_memory(len(seeds))
    for k in range(scenario.steps):
        shown = np.ascontiguousarray(skews[:, k + 1 : k + 1 + ahead])
        batch = Batch(q, 0.0 * q, skews[:, 0], shown, np.full((len(seeds), 1), 9.0))
        seen, kept = resolve_orientation(problem, batch, kept)
        # At 90° itself the cosine is the root of what rounding leaves.
        np.testing.assert_allclose(seen.nominal, frames[:, k + 1 : k + 1 + ahead], atol=1e-3, err_msg=f"step {k}")
        np.testing.assert_allclose(seen.pose, frames[:, 0], atol=1e-7)
    crossings = (np.diff(np.sign(cosine(frames)), axis=1) != 0.0).sum()
    assert crossings > 5  # or nothing was tested


@pytest.mark.parametrize(("policy", "options"), [("dls", DLS), ("rhc", {"horizon": 12, "iterations": 1})])
def test_inner_policy_plays_as_if_it_were_shown_whole_poses(policy, options):
    skew = scenarios.get("varga7-random").replace(steps=200)
    seeds = scenarios.seeds("train", 3)
    mine = rollouts(skew, baselines.make("full_orientation", skew, policy=policy, options=options), seeds)
    theirs = rollouts(with_poses(skew), baselines.make(policy, with_poses(skew), **options), seeds)
    for a, b in zip(mine, theirs, strict=True):
        np.testing.assert_allclose(a.q, b.q, atol=1e-5)
