"""Khan and Tar 2020, section 5: claims on wrong models, measurements, and solvers with inversion."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.papers.comparisons import SAME
from baselines.papers.khan.episodes import (
    CLOSED_LOOPS,
    DEVIATIONS,
    LAMBDAS,
    METHOD,
    PATHS,
    Q7Q8,
    errors,
    manufactured_arms,
    sound,
    three_seconds,
)
from baselines.papers.paper import Finding, scaled
from baselines.papers.runs import Runs
from ikgym import Plant
from ikgym.validation import FloatArray


def _compensates(runs: Runs, error: str, unit: str) -> Finding:
    """Errors beside those of the exact arm that is driven by the model's joint coordinates."""
    holds: dict[str, bool] = {}
    figures: dict[str, list[float]] = {}
    for name, path in PATHS.items():
        scenario = runs.scenario(path)
        longer = scenario.replace(iterations_per_point=(60,) * 10 + (50,), steps=600 + 5 * max(scenario.steps - 600, 0))
        runs_of = {
            "uncorrected": errors(runs, scenario, "follow_nominal"),
            "as printed": errors(runs, scenario),
            "50 inner steps": errors(runs, longer),
            "λ_a = 3e-3": errors(runs, scenario, **LAMBDAS["λ_a = 3e-3"]),
        }
        uncorrected, *corrected = (getattr(e, error) for e in runs_of.values())
        holds |= {f"{name}, {how}": e < uncorrected for how, e in zip(list(runs_of)[1:], corrected, strict=True)}
        figures[name] = [uncorrected, *corrected]
    return Finding(holds, scaled(figures, unit))


def compensates_position(runs: Runs) -> Finding:
    """Position errors."""
    return _compensates(runs, "position", "mm")


def compensates_orientation(runs: Runs) -> Finding:
    """Orientation errors."""
    return _compensates(runs, "angle", "rad")


def precise_model(runs: Runs) -> Finding:
    """Errors with an exact model beside those with the approximate one."""
    figures: dict[str, Any] = {}
    holds = True
    for name, path in PATHS.items():
        scenario = runs.scenario(path)
        exact = scenario.replace(arm=scenario.model, model=scenario.model)
        precise, other = errors(runs, exact), errors(runs, path)
        holds &= sound(runs, exact, {}) and not precise.worse(other)
        figures[f"{name} [mm]"] = 1e3 * precise.position, 1e3 * other.position
        figures[f"{name} [rad]"] = precise.angle, other.angle
    return Finding(holds, figures)


def _probing(qdot: FloatArray) -> float:
    """The share of the steps in which one joint moves alone: each other one at less than 1 % of its speed."""
    *_, second, fastest = np.sort(np.abs(qdot), axis=1).T
    return float((second < SAME * fastest).mean())


def no_exploration(runs: Runs) -> Finding:
    """Steps in which one joint moves alone, as the investigation of each direction would take."""
    shares = {name: _probing(runs.play(Q7Q8, name).qdot) for name in (METHOD, *CLOSED_LOOPS)}
    holds = {
        "the method": shares[METHOD] == 0.0,
        "beside inversion": all(shares[name] > shares[METHOD] for name in CLOSED_LOOPS),
    }
    return Finding(holds, scaled(shares, "%"))


def less_hectic(runs: Runs) -> Finding:
    """Peak joint velocities and travel beside two closed loops."""
    peaks = {name: float(np.abs(runs.play(Q7Q8, name).qdot).max()) for name in (METHOD, *CLOSED_LOOPS)}
    return Finding(all(peaks[METHOD] < peaks[name] for name in CLOSED_LOOPS), scaled(peaks, "rad/s"))


def compensates_manufacturing(runs: Runs) -> Finding:
    """As the claims on compensation, with arms that differ from the model by errors of several sizes."""
    path, holds, figures = three_seconds(runs), {}, {}
    for size in DEVIATIONS:
        arms = manufactured_arms(path, size)
        left = [errors(runs, arm, "follow_nominal").position for arm in arms]
        figures[f"{1e3 * size:g}:"] = [*left]
        for how, variant in LAMBDAS.items():
            mine = [errors(runs, arm, **variant).position for arm in arms]
            holds[f"{1e3 * size:g} mm, {how}"] = all(a < b for a, b in zip(mine, left, strict=True))
            figures[f"{1e3 * size:g}:"] += mine
    return Finding(holds, scaled(figures, "mm"))


def needs_precise_measurement(runs: Runs) -> Finding:
    """Whether an error grows with noise in the measured pose."""
    path, figures = three_seconds(runs), {}
    holds: dict[str, bool] = {}
    plants = (Plant(), *(Plant(pose_noise=size, pose_rotation_noise=size) for size in DEVIATIONS))
    for how, variant in LAMBDAS.items():
        exact, *noisy = settled = [errors(runs, path.replace(plant=plant), **variant) for plant in plants]
        holds |= {f"{1e3 * size:g} mm, {how}": e.worse(exact) for size, e in zip(DEVIATIONS, noisy, strict=True)}
        figures[f"{how} [mm]"] = [1e3 * e.position for e in settled]
        figures[f"{how} [rad]"] = [e.angle for e in settled]
    return Finding(holds, figures)
