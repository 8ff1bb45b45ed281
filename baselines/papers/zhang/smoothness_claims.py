"""Zhang 2020, section I: what is claimed of the motion with MFAPC beside that with MFAC, on four paths."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from baselines.episodes import Episode
from baselines.papers.paper import Claim, Finding, roughness
from baselines.papers.runs import Runs
from baselines.papers.zhang.comparing import falls, in_words
from baselines.papers.zhang.episodes import HELIX, LINE, adaptive, constant, predictive, settled_from
from baselines.solvers.levenberg_marquardt.damping_parameters import typical_link
from ikgym.validation import FloatArray

SINGULAR = ("faitli3-stretched", "faitli3-shoulder")
PATHS = (HELIX, LINE, *SINGULAR)
#: Constant λ in l²: the range of remark 2, and as much less again.
SHARES = (1e-5, 1e-3, 1e-1)
#: σ below this share of l is near a singular point.
NEAR = 0.05


def _both(runs: Runs, scenario: str, share: float) -> tuple[Episode, Episode]:
    """MFAC, and MFAPC with n = 5, with the same constant λ."""
    damping = share * typical_link(runs.scenario(scenario).arm) ** 2
    return constant(runs, scenario, damping), constant(runs, scenario, damping, 5)


def _pairs(
    runs: Runs, figure: Callable[[str, Episode], float], paths: tuple[str, ...]
) -> dict[str, tuple[float, float]]:
    """A figure of MFAC and of MFAPC by path and λ."""
    pairs = {}
    for path in paths:
        for share in SHARES:
            before, after = (figure(path, episode) for episode in _both(runs, path, share))
            pairs[f"`{path}`, λ = {share:g} l²"] = before, after
    return pairs


def _smoothness(runs: Runs, values: Callable[[Episode], FloatArray]) -> Finding:
    """After the transient, and in example 1 as printed with the transient as well."""

    def settled(_path: str, episode: Episode) -> float:
        return roughness(values(episode)[settled_from(episode) :])

    example = adaptive(runs), predictive(runs)
    pairs = {
        "example 1, whole run": (roughness(values(example[0])), roughness(values(example[1]))),
        "example 1, after the transient": (settled(HELIX, example[0]), settled(HELIX, example[1])),
    }
    pairs.update(_pairs(runs, settled, PATHS))
    return falls(pairs, in_words(pairs))


def _singular_points(runs: Runs) -> Finding:
    """Concentrated with singular points may mean close to one, or long near one."""

    def sigma(path: str, episode: Episode) -> FloatArray:
        return np.asarray(np.linalg.svd(runs.scenario(path).arm.jacobian(episode.q)[:, :3], compute_uv=False)[:, -1])

    def time_near(path: str, episode: Episode) -> float:
        return float((sigma(path, episode) < NEAR * typical_link(runs.scenario(path).arm)).mean())

    def closeness(path: str, episode: Episode) -> float:
        return float(1.0 / sigma(path, episode).min())

    pairs = {}
    for reading, figure in (("1 / σ", closeness), ("time near", time_near)):
        pairs.update({f"{reading}, {name}": pair for name, pair in _pairs(runs, figure, SINGULAR).items()})
    return falls(pairs, in_words(pairs))


CLAIMS = (
    Claim(
        "smoother inputs",
        "The inputs of MFAPC are smoother than those of MFAC.",
        "section I",
        "root mean square of the second differences of q, 10 % smaller, of `mfapc` with n = 5 beside `mfac`, both with "
        "`one_step`: example 1 (`mfapc_helix`, `mfac_helix`); both examples' paths and two past singular points, after "
        "60 samples, with constant λ of 1e-5, 0.001 and 0.1 l²",
        lambda runs: _smoothness(runs, lambda e: e.q),
    ),
    Claim(
        "smoother outputs",
        "The outputs with MFAPC are smoother than with MFAC.",
        "section I",
        "the same of the task coordinates",
        lambda runs: _smoothness(runs, lambda e: e.pose),
    ),
    Claim(
        "singular points",
        "MFAPC helps the robot to keep clear of isolated singular points on the path.",
        "section I",
        "the same λ on the two paths past singular points: the largest 1 / σ, with σ the smallest singular value, or "
        "the time with σ below 0.05 l, 10 % smaller",
        _singular_points,
    ),
)
