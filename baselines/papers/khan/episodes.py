"""Khan and Tar 2020: the runs that figures and claims share, and what is read from them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from baselines.episodes import Episode
from baselines.papers.paper import rms
from baselines.papers.runs import Runs
from ikgym.rotations import rotation_vector
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

Q1, Q7Q8 = "khan8-q1", "khan8-q7q8"
METHOD = "abstract_rotation"
#: The share by which the root mean square of an error has to change to count as a change: above it an error that has
#: grown is degraded, below it it has remained. The same for all claims of this paper that compare two runs.
CHANGED = 0.1
#: ℱ with the orientation's nine elements at ½; 𝒲 with the last two joints at 0.01.
LOOSE: dict[str, Any] = {"task_weights": (0.5,) * 9 + (1.0,) * 3}
BLOCKED: dict[str, Any] = {"joint_weights": (1.0,) * 6 + (0.01,) * 2}


class Points(NamedTuple):
    """What came of an episode at its grid points, each after the point's last inner step.

    Attributes:
        time: s in [s]. Shape (k,).
        nominal: Nominal task coordinates. Shape (k, 12).
        pose: Actual ones. Shape (k, 12).
        position_error: In [m]. Shape (k,).
        orientation_error: In [rad]. Shape (k,).
        q: Joint coordinates in [rad]. Shape (k, 8).
        diagnostics: Angles of both rotations in [rad], by name; each of shape (k,).
    """

    time: FloatArray
    nominal: FloatArray
    pose: FloatArray
    position_error: FloatArray
    orientation_error: FloatArray
    q: FloatArray
    diagnostics: dict[str, FloatArray]

    def settled(self, values: FloatArray) -> FloatArray:
        """Values from 1 s on, when the initial error is gone; all of them in a shorter trial."""
        late = values[self.time > 1.0]
        return late if len(late) else values


def at_points(runs: Runs, name: str | Scenario, policy: str = METHOD, **parameters: Any) -> Points:
    """The episode of a policy, seen at the grid points."""
    return points_of(runs.scenario(name), runs.play(name, policy, **parameters))


def points_of(scenario: Scenario, episode: Episode) -> Points:
    """An episode, seen at the grid points of its scenario."""
    last = scenario.counted()[1:]
    time = scenario.points()[1:][last] * scenario.dt
    return Points(
        np.asarray(time, dtype=np.float64),
        scenario.nominal()[1:][last],
        episode.pose[last],
        episode.position_error[last],
        episode.orientation_error[last],
        episode.q[last],
        {name: values[last] for name, values in episode.diagnostics.items()},
    )


def spectra(runs: Runs, name: str, **parameters: Any) -> FloatArray:
    """Real parts of the eigenvalues of J̃ᵀJ in [m²] along the path, rising; J̃ of the model, J of the arm. Shape (k, 8).

    The orientation's numbers count as [m] as they do in the method.
    """
    scenario, q = runs.scenario(name), at_points(runs, name, **parameters).q
    model, arm = (
        scenario.task.jacobian(rotation, geometric)
        for rotation, _, geometric in (a.forward_and_jacobian(q) for a in (scenario.model, scenario.arm))
    )
    return np.sort(np.linalg.eigvals(np.swapaxes(model, 1, 2) @ arm).real, axis=1)


def turned(pose: FloatArray) -> FloatArray:
    """Rotation vectors from the home orientation, in [rad], of task coordinates. Shape (k, 3)."""
    return np.array([rotation_vector(rotation) for rotation in pose[:, :9].reshape(-1, 3, 3)])


def settled_errors(points: Points) -> dict[str, float]:
    """The settled errors in numbers."""
    position, angle = points.settled(points.position_error), points.settled(points.orientation_error)
    return {
        "rms_position_error_m": rms(position),
        "largest_position_error_m": float(position.max()),
        "rms_orientation_error_rad": rms(angle),
        "largest_orientation_error_rad": float(angle.max()),
    }


def compare(runs: Runs, name: str, weights: dict[str, Any]) -> tuple[dict[str, float], dict[str, float]]:
    """The settled errors of the method without weights, and with them."""
    return settled_errors(at_points(runs, name)), settled_errors(at_points(runs, name, **weights))


def growth(before: dict[str, float], after: dict[str, float]) -> tuple[float, float]:
    """By what share the root mean squares of position and orientation error have grown."""
    position, angle = (after[key] / before[key] - 1.0 for key in ("rms_position_error_m", "rms_orientation_error_rad"))
    return position, angle


def in_words(before: dict[str, float], after: dict[str, float]) -> str:
    """The change of the settled errors, for a line of evidence."""
    position, angle = "rms_position_error_m", "rms_orientation_error_rad"
    of_position, of_angle = growth(before, after)
    return (
        f"root mean square after 1 s: orientation {before[angle]:.3f} → {after[angle]:.3f} rad ({of_angle:+.0%}), "
        f"position {1e3 * before[position]:.1f} → {1e3 * after[position]:.1f} mm ({of_position:+.0%})"
    )
