"""Faitli and Tar 2018: episodes that figures and claims share, and their Jacobians."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.episodes import Episode
from baselines.papers.comparisons import sign_changes
from baselines.papers.runs import Runs, nominal_joints
from baselines.solvers.arm_size import jacobian_bound
from ikgym.arms import Arm
from ikgym.scenarios import Scenario
from ikgym.trajectories import StraightLine
from ikgym.validation import FloatArray

STRETCHED, REGULAR, SHOULDER = "faitli3-stretched", "faitli3-regular", "faitli3-shoulder"
TRAJECTORIES = (STRETCHED, REGULAR, SHOULDER)
METHOD = "fixed_point"
#: Distances of the shoulder axis from straight lines past it, in [m].
DISTANCES = (0.1, 0.01, 0.001)


def short(name: str) -> str:
    """The name of a trajectory without that of the arm."""
    return name.removeprefix("faitli3-")


def play_method(runs: Runs, name: str | Scenario = STRETCHED, **parameters: Any) -> Episode:
    """The paper's method, with the parameters of its Table 1 unless others are given."""
    return runs.play(name, METHOD, **parameters)


def with_end_point(scenario: Scenario, a: float | None = None, link: int = 2, iterations: int = 10) -> FloatArray:
    """The joint path of the method with x extended by the end point of a link, in [rad]. Shape (steps, n).

    h becomes Jᵀ (f(q) - x) + J_ℓᵀ (p_ℓ(q) - p_ℓᴺ); where p_ℓᴺ should be, the nominal joint path tells. If A is left out
    it is one that is sure to contract, by a bound of the longer Jacobian.
    """
    model, path = scenario.model, nominal_joints(scenario)
    branch = Arm(f"{model.name} up to link {link}", model.offsets[:link], model.axes[:link], tool=model.offsets[link])
    if a is None:
        a = -min(1.0, 4.0 / (jacobian_bound(model, scenario.task) + jacobian_bound(branch, None)))
    targets, points, q, out = model.forward(path)[1], branch.forward(path[:, :link])[1], scenario.start_of(0), []
    for target, point in zip(targets, points, strict=True):
        for _ in range(iterations):
            h = model.jacobian(q)[:3].T @ (model.forward(q)[1] - target)
            h[:link] += branch.jacobian(q[:link])[:3].T @ (branch.forward(q[:link])[1] - point)
            q = q + 0.5 * a * h
        out.append(q)
    return np.array(out)


def past_shoulder(runs: Runs, distance: float) -> Scenario:
    """A straight line at 0.9 m/s past the shoulder axis at a distance in [m], with a velocity limit above all needs.

    The tool is at rest at both ends, and the elbow stays bent.
    """
    scenario = runs.scenario(REGULAR)
    radius = scenario.arm.forward(np.array([0.0, -1.3, 0.9]))[1][0]
    start = np.array([-np.arccos(distance / radius), -1.3, 0.9])
    x, y, z = scenario.arm.forward(start)[1]
    first, last = (np.concatenate([np.eye(3).ravel(), (x, way, z)]) for way in (y, -y))
    return scenario.replace(
        name=f"line at {1e3 * distance:g} mm",
        trajectory=StraightLine(first, last, duration=2.0, blend=0.5),
        start=start,
        steps=min(2000, scenario.steps),
        velocity_limit=1e4,
    )


def singular_places(runs: Runs) -> tuple[Scenario, ...]:
    """The trajectories on which yanks may occur: both with singular points, and the lines past the shoulder axis."""
    return *map(runs.scenario, (STRETCHED, SHOULDER)), *(past_shoulder(runs, d) for d in DISTANCES)


def speeds(episode: Episode) -> FloatArray:
    """The fastest joint's speed in each step, in [rad/s]. Shape (steps,)."""
    out: FloatArray = np.abs(episode.qdot).max(axis=1)
    return out


def yank(episode: Episode) -> float:
    """The largest joint velocity, as a multiple of the median over time of the fastest joint's."""
    speed = speeds(episode)
    return float(speed.max() / np.median(speed))


def jacobians(scenario: Scenario, q: FloatArray) -> FloatArray:
    """The 3×3 position Jacobians (eq. 3) in [m]. Shape (k, 3, 3)."""
    return scenario.arm.jacobian(q)[:, :3]


def singular_values(jacobian: FloatArray) -> FloatArray:
    """Singular values from the largest to the smallest, in [m]. Shape (k, 3)."""
    return np.asarray(np.linalg.svd(jacobian, compute_uv=False), dtype=np.float64)


def real_zeros(jacobian: FloatArray) -> list[int]:
    """Indices of the steps after which the real part of an eigenvalue of J changes its sign."""
    real = np.sort(np.linalg.eigvals(jacobian).real, axis=1)
    return sorted({step for column in real.T for step in sign_changes(column)})
