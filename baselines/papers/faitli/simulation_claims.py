"""Faitli and Tar 2018, sections 2.3 and 3: what is claimed of the simulation, in singularities and elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.episodes import Episode
from baselines.papers.faitli.episodes import (
    REGULAR,
    SHOULDER,
    STRETCHED,
    TRAJECTORIES,
    VISIBLE,
    jacobians,
    nominal_joints,
    real_zeros,
    sign_changes,
    singular_values,
    solved,
    times,
)
from baselines.papers.paper import Claim, Finding, rms, verdict
from baselines.papers.runs import Runs
from baselines.registry import make
from ikgym.validation import FloatArray


def _accurate(runs: Runs) -> Finding:
    shares, parts = {}, []
    for name in TRAJECTORIES:
        largest = float(solved(runs, name).position_error.max())
        shares[name] = largest / _extent(runs, name)
        parts.append(f"{1e3 * largest:.1f} mm, {shares[name]:.2%} of the extent, on `{name}`")
    return verdict(max(shares.values()) < VISIBLE, f"largest error {'; '.join(parts)}", **shares)


def _extent(runs: Runs, name: str) -> float:
    """Of the nominal path, in [m]."""
    return float(np.linalg.norm(np.ptp(runs.scenario(name).nominal(), axis=0)))


def _near_singularities(runs: Runs) -> Finding:
    numbers, parts = {}, []
    for name in (STRETCHED, SHOULDER):
        scenario, error = runs.scenario(name), solved(runs, name).position_error
        smallest = singular_values(jacobians(scenario, nominal_joints(scenario)))[:, -1]
        near = smallest < np.quantile(smallest, 0.25)
        largest = float(error[near].max())
        numbers[name] = {"share": largest / _extent(runs, name), "rms_near_m": rms(error[near])}
        parts.append(
            f"`{name}` {1e3 * largest:.1f} mm, {numbers[name]['share']:.2%} of the extent; root mean square "
            f"{1e3 * rms(error[near]):.2f} mm near, {1e3 * rms(error[~near]):.2f} mm elsewhere"
        )
    more = ", ".join(f"{1e3 * solved(runs, iterations=n).position_error.max():.1f} mm with {n}" for n in (1, 10, 100))
    return verdict(
        all(v["share"] < VISIBLE for v in numbers.values()),
        f"largest error near {'; '.join(parts)}; largest error on `{STRETCHED}`: {more} iterations",
        **numbers,
    )


def _separation(runs: Runs, name: str, episode: Episode) -> FloatArray:
    """The largest distance of a joint coordinate from its nominal one in [rad]. Shape (steps,)."""
    out: FloatArray = np.abs(episode.q - nominal_joints(runs.scenario(name))).max(axis=1)
    return out


def _somewhat(runs: Runs) -> Finding:
    apart = float(_separation(runs, STRETCHED, solved(runs)).max())
    nominal = nominal_joints(runs.scenario(STRETCHED))
    tool = float(solved(runs).position_error.max())
    return verdict(
        apart > 0.1 * np.ptp(nominal, axis=0).max(),
        f"up to {apart:.2f} rad between the joint paths, with the tool within {1e3 * tool:.1f} mm",
        largest_separation_rad=apart,
    )


def _separate(runs: Runs) -> Finding:
    scenario = runs.scenario(STRETCHED)
    time, nominal = times(scenario), nominal_joints(scenario)
    regular = float(_separation(runs, REGULAR, solved(runs, REGULAR)).max())
    apart = _separation(runs, STRETCHED, solved(runs))
    passes = time[sign_changes(np.linalg.det(jacobians(scenario, nominal)))]
    begin = float(time[int(np.argmax(apart > 10.0 * regular))])
    gap = float(np.abs(passes - begin).min()) if len(passes) else np.inf
    return verdict(
        apart.max() > 10.0 * regular and gap < 0.1,
        f"on `{REGULAR}` they stay within {1e3 * regular:.0f} mrad; on `{STRETCHED}` they part by more than ten times "
        f"that from {begin:.2f} s on, {gap:.2f} s from a singular point of the nominal path, and by "
        f"{apart.max():.2f} rad at most",
        regular_rad=regular,
        stretched_rad=float(apart.max()),
        begin_s=begin,
        gap_s=gap,
    )


def _zero_eigenvalues(runs: Runs) -> Finding:
    numbers = {}
    for name in TRAJECTORIES:
        scenario = runs.scenario(name)
        paths = {"calculated": solved(runs, name).q, "nominal": nominal_joints(scenario)}
        numbers[name] = {label: len(sign_changes(np.linalg.det(jacobians(scenario, q)))) for label, q in paths.items()}
    parts = [f"`{n}` {v['nominal']} nominal, {v['calculated']} calculated" for n, v in numbers.items()]
    return verdict(
        any(v["calculated"] > 1 for v in numbers.values()),
        f"passes through singular points, where det J changes its sign: {'; '.join(parts)}",
        **numbers,
    )


def _real_part_is_singular(runs: Runs) -> Finding:
    """A pair of conjugate eigenvalues on the imaginary axis has real part 0, and the Jacobian has full rank."""
    numbers: dict[str, Any] = {}
    parts, sound = [], True
    for name in TRAJECTORIES:
        scenario, episode = runs.scenario(name), solved(runs, name)
        jacobian = jacobians(scenario, episode.q)
        zeros = real_zeros(jacobian)
        smallest = singular_values(jacobian[zeros])[:, -1]
        false = smallest[smallest > 0.01]
        numbers[name] = {"zeros": len(zeros), "of_full_rank": len(false)}
        parts.append(
            f"`{name}` {len(zeros)} zeros of a real part, {len(false)} of them where the Jacobian is regular"
            + (f" (smallest singular value from {false.min():.2f} m)" if len(false) else "")
        )
        sound = sound and len(false) == 0
    pair = "" if sound else ": a conjugate pair crosses the imaginary axis there"
    return verdict(sound, f"{'; '.join(parts)}{pair}", **numbers)


def _rejoin(runs: Runs) -> Finding:
    """With the A of Table 1, and with that which is sure to contract whatever the joint coordinates."""
    numbers: dict[str, dict[str, float]] = {}
    sure = make("fixed_point_extended", runs.scenario(STRETCHED)).parameters["a"]
    for name in TRAJECTORIES:
        plain = float(_separation(runs, name, solved(runs, name)).max())
        extended = {a: runs.play(name, "fixed_point_extended", a=a) for a in (-1.0, sure)}
        numbers[name] = {
            "plain_rad": plain,
            **{f"A = {a:.3f}": float(_separation(runs, name, e).max()) for a, e in extended.items()},
        }
    parts = [
        f"{v['plain_rad']:.3g} rad → {v['A = -1.000']:.2g} rad on `{n}` ({v[f'A = {sure:.3f}']:.2g} rad with "
        f"A = {sure:.3f})"
        for n, v in numbers.items()
    ]
    holds = all(max(list(v.values())[1:]) < v["plain_rad"] for v in numbers.values())
    return verdict(
        holds,
        f"largest distance from the nominal joint path {'; '.join(parts)}; A = {sure:.3f} is sure to contract, by the "
        "lengths of the links",
        **numbers,
    )


CLAIMS = (
    Claim(
        "accurate tracking",
        "It is clearly visible that the tracking of the Cartesian coordinates is fairly accurate.",
        "section 2.3, fig. 2 and 3",
        "largest error on the three trajectories, 10 iterations; visible in a plot of the path is an error of 1 % of "
        "its extent",
        _accurate,
    ),
    Claim(
        "accurate in singularities",
        "Tracking is fairly accurate even in the kinematic singularities and nearby.",
        "section 3",
        "largest error in the quarter of the path with the smallest singular values, 10 iterations: the same 1 %",
        _near_singularities,
    ),
    Claim(
        "other joint coordinates",
        "The calculated joint coordinates differ somewhat from the nominal ones: other configurations do as well.",
        "section 2.3, fig. 4 and 5",
        f"distance of the joint paths on `{STRETCHED}`, more than a tenth of their range",
        _somewhat,
    ),
    Claim(
        "separation at singularities",
        "The separation of the two joint paths can happen in the kinematic singularities.",
        "section 2.3",
        "where they first part by more than ten times what they do on the trajectory without singular points: within "
        "0.1 s of one",
        _separate,
    ),
    Claim(
        "zero eigenvalues",
        "At several points at least one eigenvalue is zero: the arm goes through several kinematic singularities.",
        "section 2.3, fig. 6",
        "changes of sign of det J along the nominal and the calculated joint paths: more than one on a calculated one",
        _zero_eigenvalues,
    ),
    Claim(
        "real part zero is singular",
        "Where the plot of the real parts has a zero, the arm is singular.",
        "section 2.3, fig. 6",
        "smallest singular value of J at each zero of a real part, along the calculated paths; above 0.01 m J is "
        "regular",
        _real_part_is_singular,
    ),
    Claim(
        "end point of link 2",
        "Extending x by the end point of the second link brings the joint path back to the nominal one.",
        "section 3",
        "largest distance of the joint paths, `fixed_point` and `fixed_point_extended`, both with the A = -1 of "
        "Table 1, and the latter with its default besides; less than without on all three trajectories",
        _rejoin,
    ),
)
