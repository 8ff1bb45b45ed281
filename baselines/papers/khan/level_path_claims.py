"""Khan and Tar 2020, sections 3 and 4.2: what is claimed of the path by joint 1, without weights and with them."""

from __future__ import annotations

import numpy as np

from baselines.papers.faitli.episodes import VISIBLE
from baselines.papers.khan.episodes import (
    BLOCKED,
    CHANGED,
    LOOSE,
    METHOD,
    Q1,
    Q7Q8,
    at_points,
    compare,
    growth,
    in_words,
    settled_errors,
    turned,
)
from baselines.papers.paper import Claim, Finding, verdict, verdict_by_condition
from baselines.papers.runs import Runs
from ikgym.validation import FloatArray


def _steps_until(errors: FloatArray, level: float) -> float:
    """Inner steps until an error is below a level for the first time, NaN if it never is."""
    below = np.flatnonzero(errors < level)
    return float(below[0] + 1) if len(below) else float("nan")


def _level(runs: Runs) -> Finding:
    scenario = runs.scenario(Q1)
    nominal = scenario.nominal()
    vectors = turned(nominal)
    height, tilt = float(np.ptp(nominal[:, 11])), float(np.abs(vectors[:, :2]).max())
    actual = at_points(runs, Q1)
    varies = float(np.ptp(actual.settled(actual.pose[:, 11])))
    return verdict(
        height < 1e-12 and tilt < 1e-12,
        f"X₃ᴺ varies by {height:.0e} m, and the axis of the nominal rotation leans off the vertical by at most "
        f"{tilt:.0e} rad; actual, X₃ varies by {1e3 * varies:.0f} mm after 1 s",
        height_m=height,
        tilt_rad=tilt,
    )


def _position_relaxes(runs: Runs) -> Finding:
    scenario, episode = runs.scenario(Q1), runs.play(Q1, METHOD)
    first = scenario.nominal()[0, 9:] - scenario.arm.forward(np.zeros(scenario.joints))[1]
    initial = float(np.linalg.norm(first))
    half, tenth = (_steps_until(episode.position_error, share * initial) for share in (0.5, 0.1))
    reached = 0.0 if np.isnan(tenth) else float(scenario.points()[int(tenth)] * scenario.dt)
    return verdict(
        0.0 < reached < 0.1,
        f"{initial:.2f} m at the start, half of it after {half:.0f} inner steps, a tenth after {tenth:.0f}, that is at "
        f"s = {reached:.3f} s; root mean square after 1 s "
        f"{1e3 * settled_errors(at_points(runs, Q1))['rms_position_error_m']:.0f} mm",
        initial_m=initial,
        steps_to_half=half,
        steps_to_tenth=tenth,
    )


def _orientation_small(runs: Runs) -> Finding:
    angle = runs.play(Q1, METHOD).orientation_error
    peak = int(angle.argmax())
    half = _steps_until(angle[peak:], 0.5 * angle[peak])
    numbers = {name: settled_errors(at_points(runs, name)) for name in (Q1, Q7Q8)}
    parts = [
        f"`{n}` up to {v['largest_orientation_error_rad']:.2f} rad, root mean square "
        f"{v['rms_orientation_error_rad']:.2f} rad"
        for n, v in numbers.items()
    ]
    return Finding(
        "not testable",
        f"no number is given; after 1 s {'; '.join(parts)}; on `{Q1}` both arms are upright at home, so it starts at "
        f"0, grows to {angle[peak]:.2f} rad within {peak + 1} inner steps while the position approaches its target, "
        f"and is half of that {half:.0f} steps later",
        {**numbers, "peak_rad": float(angle[peak]), "steps_to_peak": peak + 1, "steps_from_peak_to_half": half},
    )


def _more_at_first(runs: Runs) -> Finding:
    scenario = runs.scenario(Q1)
    usual = scenario.replace(iterations_per_point=(10,), steps=min(scenario.steps, 1000))
    few, many = at_points(runs, usual), at_points(runs, Q1)
    at = [min(k, len(many.time), len(few.time)) - 1 for k in (10, 100)]
    a, b = (points.position_error[at] for points in (few, many))
    return verdict(
        bool((b < a).all()),
        f"position error at points 10 and 100: {b[0]:.2f} and {b[1]:.2f} m with 60 inner steps at the first ten "
        f"points, {a[0]:.2f} and {a[1]:.2f} m with 10",
        with_60_m=b.tolist(),
        with_10_m=a.tolist(),
    )


def _weighted_down(runs: Runs) -> Finding:
    before, after = compare(runs, Q1, LOOSE)
    _position, angle = growth(before, after)
    return verdict(angle > CHANGED, in_words(before, after), before=before, after=after)


def _coupling(runs: Runs) -> Finding:
    change, _angle = growth(*compare(runs, Q1, LOOSE))
    return verdict(
        abs(change) > CHANGED,
        f"the root mean square of the position error changes by {change:+.0%}",
        relative_change=change,
    )


def _subtle(runs: Runs) -> Finding:
    apart = np.abs(at_points(runs, Q1).q - at_points(runs, Q1, **LOOSE).q).max(axis=0)
    return Finding(
        "not testable",
        f"no number is given; they differ by up to {apart.max():.2f} rad (q{apart.argmax() + 1}), with motions of up "
        f"to {np.ptp(at_points(runs, Q1).q, axis=0).max():.2f} rad",
        {"largest_difference_rad": apart.tolist()},
    )


def moved(runs: Runs, name: str) -> Finding:
    """What joints 7 and 8 do, with 𝒲 and without."""
    free, held = (np.ptp(at_points(runs, name, **w).q[:, 6:], axis=0) for w in ({}, BLOCKED))
    return verdict(
        bool((held < 0.1 * free).all()),
        f"q7 moves over {held[0]:.3f} instead of {free[0]:.2f} rad, q8 over {held[1]:.3f} instead of {free[1]:.2f} rad",
        with_w_rad=held.tolist(),
        without_w_rad=free.tolist(),
    )


def _still_good(runs: Runs) -> Finding:
    """By the measure of the rows that speak of degraded precision, and by that of Faitli's rows on accuracy."""
    before, after = compare(runs, Q1, BLOCKED)
    grown = max(growth(before, after))
    extent = float(np.linalg.norm(np.ptp(runs.scenario(Q1).nominal()[:, 9:], axis=0)))
    share = after["largest_position_error_m"] / extent
    _position, loosened = growth(*compare(runs, Q1, LOOSE))
    return verdict_by_condition(
        {"beside the run without W": grown <= CHANGED, "beside the extent": share < VISIBLE},
        f"{in_words(before, after)}; the paper calls an orientation error of {loosened:+.0%} with F degraded; the "
        f"largest position error after 1 s is {1e3 * after['largest_position_error_m']:.0f} mm, "
        f"{share:.2%} of the path's extent",
        growth=grown,
        share_of_extent=share,
    )


CLAIMS = (
    Claim(
        "level path",
        "With q1 alone X₃ᴺ is constant, and the last link turns about an axis parallel to X₃.",
        "section 4.2, fig. 3",
        f"nominal poses of `{Q1}`, constant to 1e-12",
        _level,
    ),
    Claim(
        "initial position error relaxes",
        "The inevitable initial tracking error rapidly decreases: position.",
        "section 3; section 4.2, fig. 4",
        "inner steps to half and to a tenth; rapid is a tenth within the first hundredth of the figure's axis",
        _position_relaxes,
    ),
    Claim(
        "small errors",
        "The orientation error is small, too.",
        "section 4.2, fig. 3 and 4",
        "angles at grid points from s = 1 s on, and how the first one grows and falls",
        _orientation_small,
    ),
    Claim(
        "60 inner steps at first",
        "60 instead of 10 inner steps at the first 10 points are better for the relaxation.",
        "section 3",
        f"`{Q1}` with 60 and with 10: smaller position errors at points 10 and 100",
        _more_at_first,
    ),
    Claim(
        "F weights orientation down",
        "With F_ii = 0.5 for i = 1 … 9 the orientation precision is degraded.",
        "section 4.2, fig. 7",
        f"`{Q1}` with `task_weights`: degraded is a root mean square of the error that grows by more than a tenth",
        _weighted_down,
    ),
    Claim(
        "F couples",
        "This shows some coupling with the tracking error of the end point.",
        "section 4.2, fig. 7",
        "change of the root mean square of the position error, by more than a tenth",
        _coupling,
    ),
    Claim(
        "subtle differences",
        "With F subtle differences appear in the joint coordinates.",
        "section 4.2, fig. 8 and 5",
        "largest distance of the joint coordinates",
        _subtle,
    ),
    Claim(
        "W blocks joints",
        "With W_77 = W_88 = 0.01 the joints 7 and 8 are really blocked.",
        "section 4.2, fig. 10",
        f"range of q7 and q8 on `{Q1}`, with and without: below a tenth",
        lambda runs: moved(runs, Q1),
    ),
    Claim(
        "W keeps precision",
        "With W on the path by q1 the tracking precision remains good.",
        "section 4.2, fig. 9",
        f"`{Q1}` with `joint_weights`, in two readings: remained, neither root mean square grows by more than a tenth, "
        "which is degraded in the other rows; good, the largest position error is below 1 % of the path's extent, the "
        "width of a line",
        _still_good,
    ),
)
