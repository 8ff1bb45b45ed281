"""Zhang 2020, section V: what is claimed of the two examples."""

from __future__ import annotations

import numpy as np

from baselines.papers.paper import Claim, Finding, verdict
from baselines.papers.runs import Runs
from baselines.papers.zhang.comparing import CHANGE, SAME, change
from baselines.papers.zhang.episodes import HELIX, LINE, constant, iterative, lambdas_used, predictive, settled_from
from baselines.status import Status
from ikgym.rotations import rodrigues, rotation_vector

SWITCH = 33  # the sample at which λ turns, as printed


def _switch(runs: Runs) -> Finding:
    lambdas = lambdas_used(predictive(runs))
    turn = int(lambdas.argmax()) + 1
    return verdict(
        turn == SWITCH, f"λ turns at k = {turn}, at {lambdas.max():.2f} m²", sample=turn, lambda_m2=float(lambdas.max())
    )


def _up_and_down(runs: Runs) -> Finding:
    change = np.diff(lambdas_used(predictive(runs)))
    turns = int((np.diff(np.sign(change)) != 0.0).sum())
    return verdict(
        turns == 1 and change[0] > 0.0,
        f"{int((change > 0.0).sum())} samples up, then {int((change < 0.0).sum())} down, {turns} turn between them",
        turns=turns,
    )


def _poor_start(runs: Runs) -> Finding:
    error = predictive(runs).position_error
    start = min(8, len(error) // 2)
    first, later = float(error[:start].max()), float(error[settled_from(predictive(runs)) :].max())
    return verdict(
        first > later,
        f"errors up to {first:.1f} m in the first {start} samples, {1e3 * later:.0f} mm after the transient",
        first_m=first,
        later_m=later,
    )


def _faster(runs: Runs) -> Finding:
    free = predictive(runs)
    peak = float(lambdas_used(free).max())
    held = constant(runs, HELIX, round(peak, 4), 5)
    a, b = (float(e.position_error[settled_from(e) :].max()) for e in (held, free))
    return verdict(
        change(a, b) <= -CHANGE,
        f"largest error after the transient {1e3 * b:.1f} mm, {1e3 * a:.1f} mm with λ held at {peak:.2f} m²",
        falling_m=b,
        held_m=a,
    )


def _excellent(runs: Runs) -> Finding:
    """Of the path's extent and, on the line, of the whole turn."""
    helix, line = predictive(runs), iterative(runs)
    nominal = runs.scenario(LINE).nominal()
    ways = runs.scenario(LINE).task.error(nominal[-1], nominal[0])
    round_trip = float(np.linalg.norm(np.ptp(runs.scenario(HELIX).nominal(), axis=0)))
    shares = {
        "helix": float(helix.position_error[settled_from(helix) :].max()) / round_trip,
        "line": float(line.position_error.max() / np.linalg.norm(ways[:3])),
        "turn": float(line.orientation_error.max() / np.linalg.norm(ways[3:])),
    }
    return verdict(
        max(shares.values()) < SAME,
        f"{100 * shares['helix']:.2f} % of the extent on the helix, once its transient is over; the model being exact, "
        f"{100 * shares['line']:.1g} % of the way and {100 * shares['turn']:.1g} % of the turn on the line",
        **shares,
    )


def _within_ten(runs: Runs) -> Finding:
    episode = iterative(runs, stop="first_point")
    met, most = float((episode.status == Status.CONVERGED).mean()), int(episode.iterations.max())
    return verdict(
        met == 1.0 and most <= 10,
        f"{100 * met:.0f} % of the points met to δ = 1e-10, in {most} iterations at most",
        share_met=met,
        most_iterations=most,
    )


def _horizon_met(runs: Runs) -> Finding:
    episode = iterative(runs)
    limit = float((episode.status == Status.ITERATION_LIMIT).mean())
    patient = iterative(runs, iterations=100)
    still = float((patient.status == Status.ITERATION_LIMIT).mean())
    return verdict(
        limit == 0.0,
        f"(40) is unmet after 10 iterations in {100 * limit:.1f} % of the samples, after 100 in {100 * still:.1f} %: "
        "once the first point is met, the second is but to the second order of the way in one period",
        share_after_10=limit,
        share_after_100=still,
    )


def _printed_angle(runs: Runs) -> Finding:
    """Like (51)-(54), from the product of two rotations about the same axis."""
    del runs
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    wrong: dict[str, float] = {}
    right: dict[str, float] = {}
    for angle in (1e-2, 1e-4, 1e-6, 1e-8):
        d = rodrigues(axis, 1.0 + angle) @ rodrigues(axis, 1.0).T
        with np.errstate(invalid="ignore", divide="ignore"):
            theta = np.arccos((np.trace(d) - 1.0) / 2.0)
            printed = (
                np.array([d[2, 1] - d[1, 2], d[0, 2] - d[2, 0], d[1, 0] - d[0, 1]]) / (2.0 * np.sin(theta)) * theta
            )
        for errors, vector in ((wrong, printed), (right, rotation_vector(d))):
            error = float(np.linalg.norm(vector - angle * axis) / angle)
            errors[f"{angle:.0e} rad"] = error if np.isfinite(error) else 1.0
    lost = [angle for angle, error in wrong.items() if error > 1e-6]
    best = max(error for angle, error in right.items() if angle in lost) if lost else 0.0
    return verdict(
        not lost,
        f"more than the sixth digit is wrong or no number comes out at {', '.join(lost)}; the atan2 form used here is "
        f"right to {'the sixth' if best < 1e-6 else 'no sixth'} digit there",
        **{f"printed at {angle}": error for angle, error in wrong.items()},
    )


CLAIMS = (
    Claim(
        "switch at 33",
        "The error falls below 10 at k = 33, and λ turns there.",
        "section V, example 1, fig. 3",
        "`zhang3-helix`, `mfapc_helix`: sample of the largest λ",
        _switch,
    ),
    Claim(
        "up, then down",
        "λ increases at first, and decreases from one sample on.",
        "section V, example 1, fig. 3",
        "signs of the changes of λ",
        _up_and_down,
    ),
    Claim(
        "poor start",
        "The tracking is poor at first, as the initial values violate the kinematics.",
        "section V, example 1, fig. 2",
        "largest errors at the start and after the transient",
        _poor_start,
    ),
    Claim(
        "falling λ",
        "The falling λ accelerates the convergence of the tracking error.",
        "section V, example 1",
        "largest error after the transient, 10 % smaller than with λ held at its peak",
        _faster,
    ),
    Claim(
        "excellent",
        "MFAPC shows an excellent control performance.",
        "abstract; section VI",
        "largest errors of both examples: excellent is less than 1 % of the path's extent, which no figure shows",
        _excellent,
    ),
    Claim(
        "ten iterations",
        "Iterative MFAPC with n = 2 and λ = 0 tracks the line with at most 10 iterations a period.",
        "section V, example 2, fig. 6, 7 and 9",
        '`zhang6-lspb`, `mfapc_line` with `stop="first_point"`: share of the points met and iterations',
        _within_ten,
    ),
    Claim(
        "whole horizon",
        "The iteration finds the minimum of the error of the whole horizon, which ends it.",
        "section IV C, eq. 40; section V, example 2, part A",
        "`zhang6-lspb`, `mfapc_line` as printed: share of the samples at which δ = 1e-10 was not reached",
        _horizon_met,
    ),
    Claim(
        "printed angle",
        "The rotation between two orientations follows from (52)–(54).",
        "section V, example 2, eq. 52–54",
        "rotations of 1e-2 to 1e-8 rad, which δ = 1e-10 asks for",
        _printed_angle,
    ),
)
