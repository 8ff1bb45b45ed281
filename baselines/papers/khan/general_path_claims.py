"""Khan and Tar 2020, section 4.3: what is claimed of the path by joints 7 and 8, and of the eigenvalues along it."""

from __future__ import annotations

import numpy as np

from baselines.papers.khan.episodes import (
    BLOCKED,
    CHANGED,
    METHOD,
    Q1,
    Q7Q8,
    at_points,
    compare,
    growth,
    in_words,
    settled_errors,
    spectra,
    turned,
)
from baselines.papers.khan.level_path_claims import moved
from baselines.papers.paper import Claim, Finding, verdict
from baselines.papers.runs import Runs
from baselines.status import Status

NOUGHT = 1e-9  # [m²]: an eigenvalue of J̃ᵀJ below this is rounding


def _general(runs: Runs) -> Finding:
    nominal = runs.scenario(Q7Q8).nominal()
    extent, vectors = np.ptp(nominal[:, 9:], axis=0), turned(nominal)
    rank = np.linalg.svd(vectors, compute_uv=False)
    return verdict(
        bool((extent > 0.0).all()) and rank[1] > 1e-6 * rank[0],
        f"X₁, X₂, X₃ range over {', '.join(f'{e:.2f}' for e in extent)} m; rotation from home up to "
        f"{np.linalg.norm(vectors, axis=1).max():.2f} rad, about changing axes",
        extent_m=extent.tolist(),
    )


def _acceptable(runs: Runs) -> Finding:
    errors = settled_errors(at_points(runs, Q7Q8))
    extent = float(np.linalg.norm(np.ptp(runs.scenario(Q7Q8).nominal()[:, 9:], axis=0)))
    return Finding(
        "not testable",
        f"no number is given; root mean squares after 1 s {1e3 * errors['rms_position_error_m']:.0f} mm and "
        f"{errors['rms_orientation_error_rad']:.2f} rad, "
        f"{1e3 * errors['largest_position_error_m']:.0f} mm, {errors['largest_position_error_m'] / extent:.1%} of the "
        f"path's extent, and {errors['largest_orientation_error_rad']:.2f} rad at most",
        {**errors},
    )


def _degraded(runs: Runs) -> Finding:
    before, after = compare(runs, Q7Q8, BLOCKED)
    return verdict(min(growth(before, after)) > CHANGED, in_words(before, after), before=before, after=after)


def _stable(runs: Runs) -> Finding:
    """On the path the error must not grow; with the target held, it must fall for as long as one looks."""
    episode, points = runs.play(Q7Q8, METHOD, **BLOCKED), at_points(runs, Q7Q8, **BLOCKED)
    sound = bool((episode.status <= int(Status.ITERATION_LIMIT)).all())
    scenario = runs.scenario(Q7Q8)
    held = runs.play(scenario.replace(iterations_per_point=(scenario.steps,)), METHOD, **BLOCKED)
    at = [min(k, scenario.steps) - 1 for k in (1_000, 10_000, 100_000)]
    position, angle = held.position_error[at], held.orientation_error[at]
    falls = bool((np.diff(position) <= 0.0).all() and (np.diff(angle) <= 0.0).all())
    return verdict(
        sound and falls and points.position_error[-1] <= points.position_error[0],
        f"{'no step' if sound else 'a step'} diverged or failed; with the first point held the errors after 1e3, 1e4 "
        f"and 1e5 inner steps are {', '.join(f'{1e3 * e:.0f}' for e in position)} mm and "
        f"{', '.join(f'{a:.3f}' for a in angle)} rad",
        held_position_error_m=position.tolist(),
        held_orientation_error_rad=angle.tolist(),
    )


def _smallest(runs: Runs) -> Finding:
    least = spectra(runs, Q7Q8, **BLOCKED)[:, 0]
    size = float(np.median(np.abs(least)))
    return verdict(
        1e-15 < size < 1e-13 and bool(least.min() < 0.0 < least.max()),
        f"between {least.min():.1e} and {least.max():.1e} m², {size:.0e} in the median of absolute values",
        smallest=float(least.min()),
        largest=float(least.max()),
        median=size,
    )


def _wide(runs: Runs) -> Finding:
    most = spectra(runs, Q7Q8, **BLOCKED)[:, -1]
    return Finding(
        "not testable",
        f"no number is given; it lies between {most.min():.0f} and {most.max():.0f} m², a factor of "
        f"{most.max() / most.min():.2f}",
        {"smallest": float(most.min()), "largest": float(most.max())},
    )


def _delicate(runs: Runs) -> Finding:
    """What vanishes at every point of every path says nothing of the path."""
    real = np.concatenate([spectra(runs, Q1), spectra(runs, Q7Q8, **BLOCKED)])
    vanishing = (np.abs(real) < NOUGHT).sum(axis=1)
    always = bool((vanishing == 2).all())
    count = "two" if always else f"{vanishing.min()} to {vanishing.max()}"
    slowest = 1.0 / (5e-4 * real[:, 2].min())
    return verdict(
        not always,
        f"{count} eigenvalues vanish at each point of both paths, as two must with 8 joints and 6 degrees of "
        "freedom, whatever the path; the problem is delicate for another reason: the other six lie "
        f"between {real[:, 2].min():.1g} and {real[:, -1].max():.0f} m², so that the slowest part of an error needs up "
        f"to {slowest:.0e} inner steps to fall to 1/e",
        vanishing_at_least=int(vanishing.min()),
        vanishing_at_most=int(vanishing.max()),
        third_smallest=float(real[:, 2].min()),
        largest=float(real[:, -1].max()),
    )


CLAIMS = (
    Claim(
        "general path",
        "With q7 and q8 all of X₁, X₂, X₃ vary, and the orientation changes in a complicated way.",
        "section 4.3, fig. 11 and 12",
        f"nominal poses of `{Q7Q8}`: each coordinate varies, and the axis of the rotation from home changes",
        _general,
    ),
    Claim(
        "acceptable solutions",
        "The path by q7 and q8 has acceptable solutions.",
        "section 4.3, fig. 12 to 15",
        "errors after 1 s",
        _acceptable,
    ),
    Claim(
        "W degrades q7 and q8",
        "With W on the path by q7 and q8 the precision is degraded.",
        "section 4.3, fig. 16",
        f"errors on `{Q7Q8}` with and without: both root mean squares grow by more than a tenth",
        _degraded,
    ),
    Claim(
        "W reduces q7 and q8",
        "With W on the path by q7 and q8 the motion of the last two joints is reduced.",
        "section 4.3, fig. 17",
        f"range of q7 and q8 on `{Q7Q8}`, with and without: below a tenth",
        lambda runs: moved(runs, Q7Q8),
    ),
    Claim(
        "stable and convergent",
        "With W on the path by q7 and q8 the algorithm remains stable and convergent.",
        "section 4.3, fig. 18",
        "no step fails, and the last error on the path is not above the first; with the first grid point held for the "
        "whole episode errors fall",
        _stable,
    ),
    Claim(
        "smallest eigenvalue",
        "The smallest real part of the eigenvalues of J̃ᵀJ scatters around 0 with an order of 1e-14.",
        "section 4.3, fig. 19",
        f"eigenvalues along the path of `{Q7Q8}` with W: on both sides of 0, their size between 1e-15 and 1e-13 m² in "
        "the median",
        _smallest,
    ),
    Claim(
        "largest eigenvalue",
        "The largest real part varies within a wide range.",
        "section 4.3, fig. 19",
        "the same",
        _wide,
    ),
    Claim(
        "delicate by the zero",
        "The vanishing smallest eigenvalue testifies that a numerically delicate, nontrivial problem was solved.",
        "section 4.3, fig. 19",
        f"number of eigenvalues below {NOUGHT:g} m² at each point of both paths",
        _delicate,
    ),
)
