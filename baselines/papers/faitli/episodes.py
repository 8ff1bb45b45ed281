"""Faitli and Tar 2018: the runs that figures and claims share, and what is read from them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.evaluation.rollout import Episode
from baselines.papers.runs import Runs
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

STRETCHED, REGULAR, SHOULDER = "faitli3-stretched", "faitli3-regular", "faitli3-shoulder"
TRAJECTORIES = (STRETCHED, REGULAR, SHOULDER)
METHOD = "fixed_point"


def solved(runs: Runs, name: str = STRETCHED, **parameters: Any) -> Episode:
    """The paper's method, with the parameters of its Table 1 unless others are given."""
    return runs.play(name, METHOD, **parameters)


def jacobians(scenario: Scenario, q: FloatArray) -> FloatArray:
    """The 3×3 position Jacobians (eq. 3) in [m]. Shape (k, 3, 3)."""
    return scenario.arm.jacobian(q)[:, :3]


def singular_values(jacobian: FloatArray) -> FloatArray:
    """From the largest to the smallest, in [m]. Shape (k, 3)."""
    return np.asarray(np.linalg.svd(jacobian, compute_uv=False), dtype=np.float64)


def sign_changes(values: FloatArray) -> npt.NDArray[np.intp]:
    """Numbers of the steps after which values change their sign. Shape (c,)."""
    return np.flatnonzero(np.diff(np.sign(values)))


def real_zeros(jacobian: FloatArray) -> npt.NDArray[np.intp]:
    """Numbers of the steps after which a real part of an eigenvalue changes its sign."""
    real = np.sort(np.linalg.eigvals(jacobian).real, axis=1)
    return np.unique(np.concatenate([sign_changes(column) for column in real.T]))


def times(scenario: Scenario) -> FloatArray:
    """Times at the end of each step, in [s]. Shape (steps,)."""
    return scenario.times(scenario.steps + 1)[1:]


def nominal_joints(scenario: Scenario) -> FloatArray:
    """The joint coordinates that generate the nominal path, in [rad]. Shape (steps, n).

    Raises:
        InvalidInputError: The scenario has no such path.
    """
    path = scenario.nominal_joint_path()
    if path is None:
        raise InvalidInputError(f"scenario {scenario.name!r} has no joint path to compare with.")
    return path[1:]
