"""Zhang 2020, section V: what is claimed of the two examples."""

from __future__ import annotations

import numpy as np

from baselines.papers.paper import Claim, Finding, verdict, verdict_by_condition
from baselines.papers.runs import Runs
from baselines.papers.zhang.comparing import CHANGE, SAME, change
from baselines.papers.zhang.episodes import (
    HELIX,
    LINE,
    constant,
    iterative,
    lambdas_used,
    listed,
    predictive,
    settled_from,
)
from baselines.policy import Batch
from baselines.registry import make
from baselines.solvers.levenberg_marquardt.iteration import DampingMemory
from baselines.status import Status
from ikgym.rotations import rodrigues, rotation_vector
from ikgym.validation import FloatArray

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


def _left(runs: Runs) -> float:
    """The largest error of the horizon that (40) leaves unmet, as a share of the way of the period ahead."""
    scenario, episode = runs.scenario(LINE), iterative(runs)
    policy = make("mfapc_line", scenario)
    nominal, later = scenario.nominal(preview=policy.preview), np.arange(2, len(episode.q) + 1)
    q, ahead = episode.q[:-1], np.stack([nominal[later], nominal[later + 1]], axis=1)
    batch = Batch(q, np.zeros_like(q), episode.pose[:-1], ahead, np.ones((len(q), 1)))
    solution = policy.solve(batch, policy.memory(len(q)))
    unmet = solution.status == Status.ITERATION_LIMIT
    way = np.linalg.norm(scenario.task.error(ahead[unmet, 1], ahead[unmet, 0]), axis=1)
    return float((DampingMemory(*solution.memory).error[unmet] / way).max())


def _horizon_met(runs: Runs) -> Finding:
    limits = {n: iterative(runs, iterations=n).status == Status.ITERATION_LIMIT for n in (10, 100)}
    unmet, left = {n: 100.0 * float(limit.mean()) for n, limit in limits.items()}, _left(runs)
    return verdict_by_condition(
        {"to δ": unmet[10] == 0.0, "to 1 %": left < SAME},
        f"(40) is unmet after 10 iterations in {unmet[10]:.1f} % of the samples, after 100 in {unmet[100]:.1f} %: once "
        "the first point is met, the second is but to the second order of the way in one period, of which at most "
        f"{100 * left:.2g} % is left",
        unmet_percent=unmet,
        left_share=left,
    )


def _printed(d: FloatArray) -> FloatArray:
    """(52)-(54) as printed; no number where they are 0/0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        theta = np.arccos((np.trace(d) - 1.0) / 2.0)
        axis = np.array([d[2, 1] - d[1, 2], d[0, 2] - d[2, 0], d[1, 0] - d[0, 1]]) / (2.0 * np.sin(theta))
        return np.asarray(axis * theta)


def _printed_angle(runs: Runs) -> Finding:
    """Like (51)-(54), from the product of two rotations about the same axis."""
    del runs
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    printed: dict[str, float] = {}
    ours: dict[str, float] = {}
    for angle in (1e-2, 1e-4, 1e-6, 1e-8):
        d = rodrigues(axis, 1.0 + angle) @ rodrigues(axis, 1.0).T
        for errors, vector in ((printed, _printed(d)), (ours, rotation_vector(d))):
            error = float(np.linalg.norm(vector - angle * axis) / angle)
            errors[f"{angle:.0e} rad"] = error if np.isfinite(error) else 1.0
    return verdict_by_condition(
        {angle: error < SAME for angle, error in printed.items()},
        f"relative error {listed(printed, '.1g')}, where 1 stands for no number as well; with atan2 "
        f"{'all are' if max(ours.values()) < SAME else 'not all are'} right",
        **printed,
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
        "`zhang6-lspb`, `mfapc_line` as printed: share of the samples at which δ = 1e-10 was not reached; or, as the "
        "minimum is 0, whether less than 1 % of the way of one period is left",
        _horizon_met,
    ),
    Claim(
        "printed angle",
        "The rotation between two orientations follows from (52)–(54).",
        "section V, example 2, eq. 52–54",
        "rotations of 1e-2 to 1e-8 rad, which δ = 1e-10 asks for: right to 1 %",
        _printed_angle,
    ),
)
