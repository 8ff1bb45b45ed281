"""Khan and Tar 2020: episodes that figures and claims share, their errors and eigenvalues."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from baselines.papers.comparisons import larger, rms
from baselines.papers.paper import Figures
from baselines.papers.runs import Runs
from baselines.status import Status
from ikgym import Plant
from ikgym.kernels.rotations import rotation_vector
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

Q1, Q7Q8 = "khan8-q1", "khan8-q7q8"
METHOD = "abstract_rotation"
#: Parameters of the method.
Variant = dict[str, Any]

PATHS = {"q1": Q1, "q7q8": Q7Q8}
#: Closed loops with inversion under the same wrong model.
CLOSED_LOOPS = ("moore_penrose", "broyden")
#: λ_a as printed (5e-4), and a larger one.
LAMBDAS: dict[str, Variant] = {"as printed": {}, "λ_a = 3e-3": {"lambda_a": 3e-3}}
#: Standard deviations of joint zeros, axes and measured orientations in [rad], of links and measured positions in [m].
DEVIATIONS = (1e-3, 1e-2, 1e-1)
#: ℱ with the orientation's nine elements at ½; 𝒲 with the last two joints at 0.01.
LOOSE: Variant = {"task_weights": (0.5,) * 9 + (1.0,) * 3}
BLOCKED: Variant = {"joint_weights": (1.0,) * 6 + (0.01,) * 2}


class Points(NamedTuple):
    """An episode at its k grid points, each after the point's last inner step.

    Times in [s], task coordinates (k, 12), errors in [m] and [rad], joint coordinates (k, 8) in [rad], and angles of
    both rotations in [rad] by name.
    """

    time: FloatArray
    nominal: FloatArray
    pose: FloatArray
    position_error: FloatArray
    orientation_error: FloatArray
    q: FloatArray
    diagnostics: dict[str, FloatArray]

    def after_start(self, values: FloatArray) -> FloatArray:
        """Values from 1 s on, after the initial error has vanished; all values in a shorter trial."""
        late = values[self.time > 1.0]
        return late if len(late) else values


def at_points(runs: Runs, name: str | Scenario, policy: str = METHOD, **parameters: Any) -> Points:
    """The episode of a policy at the grid points of the scenario."""
    scenario, episode = runs.scenario(name), runs.play(name, policy, **parameters)
    last = scenario.counted()[1:]
    return Points(
        np.asarray(scenario.points()[1:][last] * scenario.dt, dtype=np.float64),
        scenario.nominal()[1:][last],
        episode.pose[last],
        episode.position_error[last],
        episode.orientation_error[last],
        episode.q[last],
        {name: values[last] for name, values in episode.diagnostics.items()},
    )


class Errors(NamedTuple):
    """Errors at the grid points after 1 s, in [m] and [rad]: root mean squares, and the largest."""

    position: float
    angle: float
    largest_position: float
    largest_angle: float

    def worse(self, than: Errors) -> bool:
        """Whether either root mean square is a tenth larger than another's."""
        return larger(self.position, than.position) or larger(self.angle, than.angle)


def errors(runs: Runs, name: str | Scenario, policy: str = METHOD, **parameters: Any) -> Errors:
    """The errors of a policy."""
    points = at_points(runs, name, policy, **parameters)
    position, angle = points.after_start(points.position_error), points.after_start(points.orientation_error)
    return Errors(rms(position), rms(angle), float(position.max()), float(angle.max()))


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


def rotation_vectors(pose: FloatArray) -> FloatArray:
    """Rotation vectors from the home orientation, in [rad], of task coordinates. Shape (k, 3)."""
    return np.array([rotation_vector(rotation) for rotation in pose[:, :9].reshape(-1, 3, 3)])


def sound(runs: Runs, scenario: str | Scenario, variant: Variant) -> bool:
    """Whether no step of a variant of the method diverges or fails."""
    return bool((runs.play(scenario, METHOD, **variant).status <= int(Status.ITERATION_LIMIT)).all())


def no_worse(runs: Runs, one: Variant, other: Variant) -> bool:
    """Whether no step of a variant fails on either path, and neither error is a tenth larger than another's."""
    return all(
        sound(runs, path, one) and not errors(runs, path, **one).worse(errors(runs, path, **other))
        for path in PATHS.values()
    )


def both(name: str, *settled: Errors) -> dict[str, list[float]]:
    """The root mean squares of several errors as figures of one name, in their order."""
    return {f"{name} [mm]": [1e3 * e.position for e in settled], f"{name} [rad]": [e.angle for e in settled]}


def errors_of_variants(runs: Runs, *variants: Variant) -> Figures:
    """The errors of several variants on both paths, in their order."""
    figures: dict[str, list[float]] = {}
    for name, path in PATHS.items():
        figures |= both(name, *(errors(runs, path, **variant) for variant in variants))
    return figures


def three_seconds(runs: Runs) -> Scenario:
    """The path by joints 7 and 8 to s = 3 s."""
    scenario = runs.scenario(Q7Q8)
    return scenario.replace(name=f"{Q7Q8}, 3 s", steps=min(30_500, scenario.steps))


def manufactured_arms(path: Scenario, size: float) -> list[Scenario]:
    """A scenario with two arms whose joint zeros, links and axes differ from the model, by a size in [m] and [rad]."""
    source = path.replace(arm=path.model, plant=Plant(zero=size, link=size, axis=size))
    return [path.replace(arm=source.drawn_plant(seed).arm, model=path.model) for seed in range(2)]
