"""Khan and Tar 2020: the tests of the claims in ``claims.toml``, each function named after its claim.

Those of section 2 are in :mod:`baselines.papers.khan.without_jacobian`. One file, although long: all others in their
order.
"""

from __future__ import annotations

import numpy as np

from baselines.papers.comparisons import SAME, differ, extent, larger, peak_speed
from baselines.papers.khan.episodes import (
    BLOCKED,
    CLOSED_LOOPS,
    DEVIATIONS,
    LAMBDAS,
    LOOSE,
    METHOD,
    PATHS,
    Q1,
    Q7Q8,
    Errors,
    Variant,
    at_points,
    both,
    errors,
    errors_of_variants,
    manufactured_arms,
    no_worse,
    rotation_vectors,
    sound,
    spectra,
    three_seconds,
)
from baselines.papers.paper import Figures, Finding, in_unit
from baselines.papers.runs import Runs
from ikgym import Plant


def _errors_with_weights(runs: Runs, name: str, weights: Variant) -> tuple[Errors, Errors]:
    """The settled errors of the method without weights, and with them."""
    return errors(runs, name), errors(runs, name, **weights)


def _before_and_after(before: Errors, after: Errors) -> Figures:
    return {
        "position [mm]": (1e3 * before.position, 1e3 * after.position),
        "orientation [rad]": (before.angle, after.angle),
    }


def level_path(runs: Runs) -> Finding:
    """Variation of the height, and lean of the axis of rotation, along the nominal path."""
    nominal = runs.scenario(Q1).nominal()
    height, lean = float(np.ptp(nominal[:, 11])), float(np.abs(rotation_vectors(nominal)[:, :2]).max())
    return Finding(height < 1e-12 and lean < 1e-12, {"X₃ [m]": height, "lean [rad]": lean})


def initial_position_error_relaxes(runs: Runs) -> Finding:
    """Inner steps to a tenth of the initial position error."""
    scenario, episode = runs.scenario(Q1), runs.play(Q1, METHOD)
    first = scenario.nominal()[0, 9:] - scenario.arm.forward(np.zeros(scenario.joints))[1]
    tenth = np.flatnonzero(episode.position_error < 0.1 * np.linalg.norm(first))
    reached = float(scenario.points()[tenth[0] + 1] * scenario.dt) if len(tenth) else 0.0
    return Finding(0.0 < reached < 0.1, {"[s]": reached})


def small_orientation_error(runs: Runs) -> Finding:
    """Orientation errors on both paths."""
    settled = [errors(runs, path) for path in PATHS.values()]
    figures = {"RMS [rad]": [e.angle for e in settled], "largest [rad]": [e.largest_angle for e in settled]}
    return Finding(None, figures)


def sixty_inner_steps(runs: Runs) -> Finding:
    """Position errors at points 10 and 100, with 60 and with 10 inner steps at the first points."""
    scenario = runs.scenario(Q1)
    few = at_points(runs, scenario.replace(iterations_per_point=(10,), steps=min(scenario.steps, 1000)))
    many = at_points(runs, Q1)
    at = [min(k, len(many.time), len(few.time)) - 1 for k in (10, 100)]
    a, b = few.position_error[at], many.position_error[at]
    return Finding(bool((b < a).all()), {"with 10 [m]": a.tolist(), "with 60 [m]": b.tolist()})


def f_weights_orientation_down(runs: Runs) -> Finding:
    """Orientation error without and with ℱ."""
    before, after = _errors_with_weights(runs, Q1, LOOSE)
    return Finding(larger(after.angle, before.angle), _before_and_after(before, after))


def f_couples(runs: Runs) -> Finding:
    """Position error without and with ℱ."""
    before, after = _errors_with_weights(runs, Q1, LOOSE)
    return Finding(differ(after.position, before.position), {"[mm]": (1e3 * before.position, 1e3 * after.position)})


def subtle_differences(runs: Runs) -> Finding:
    """Distance of the joint coordinates without and with ℱ."""
    apart = np.abs(at_points(runs, Q1).q - at_points(runs, Q1, **LOOSE).q).max(axis=0)
    motion = float(np.ptp(at_points(runs, Q1).q, axis=0).max())
    return Finding(None, {"[rad]": float(apart.max()), "of [rad]": motion})


def _ranges_of_blocked(runs: Runs, name: str) -> Finding:
    """Ranges of joints 7 and 8, without and with 𝒲."""
    free, held = (np.ptp(at_points(runs, name, **w).q[:, 6:], axis=0) for w in ({}, BLOCKED))
    return Finding(bool((held < 0.1 * free).all()), {"without [rad]": free.tolist(), "with [rad]": held.tolist()})


def w_blocks_joints(runs: Runs) -> Finding:
    """On the path by joint 1."""
    return _ranges_of_blocked(runs, Q1)


def w_keeps_precision(runs: Runs) -> Finding:
    """Against the run without 𝒲, and against the path's extent."""
    before, after = _errors_with_weights(runs, Q1, BLOCKED)
    share = after.largest_position / extent(runs.scenario(Q1).nominal()[:, 9:])
    holds = {"against the run without W": not after.worse(before), "against the extent": share < SAME}
    return Finding(holds, {**_before_and_after(before, after), "of the extent [%]": 100.0 * share})


def general_path(runs: Runs) -> Finding:
    """Ranges of the nominal coordinates, and whether the axis of the rotation from home changes."""
    nominal = runs.scenario(Q7Q8).nominal()
    ranges, vectors = np.ptp(nominal[:, 9:], axis=0), rotation_vectors(nominal)
    rank = np.linalg.svd(vectors, compute_uv=False)
    largest = float(np.linalg.norm(vectors, axis=1).max())
    holds = bool((ranges > 0.0).all()) and rank[1] > 1e-6 * rank[0]
    return Finding(holds, {"[m]": ranges.tolist(), "rotation [rad]": largest})


def acceptable_solutions(runs: Runs) -> Finding:
    """Errors on the path by joints 7 and 8."""
    settled = errors(runs, Q7Q8)
    figures = {
        "RMS [mm]": 1e3 * settled.position,
        "[rad]": settled.angle,
        "largest [mm]": 1e3 * settled.largest_position,
    }
    return Finding(None, figures)


def w_degrades_q7_and_q8(runs: Runs) -> Finding:
    """Errors without and with 𝒲."""
    before, after = _errors_with_weights(runs, Q7Q8, BLOCKED)
    holds = larger(after.position, before.position) and larger(after.angle, before.angle)
    return Finding(holds, _before_and_after(before, after))


def w_reduces_q7_and_q8(runs: Runs) -> Finding:
    """On the path by joints 7 and 8."""
    return _ranges_of_blocked(runs, Q7Q8)


def stable_and_convergent(runs: Runs) -> Finding:
    """On the path the error must not grow; with the target held, it must keep falling."""
    points, scenario = at_points(runs, Q7Q8, **BLOCKED), runs.scenario(Q7Q8)
    held = runs.play(scenario.replace(iterations_per_point=(scenario.steps,)), METHOD, **BLOCKED)
    at = [min(k, scenario.steps) - 1 for k in (1_000, 10_000, 100_000)]
    position, angle = held.position_error[at], held.orientation_error[at]
    falls = bool((np.diff(position) <= 0.0).all() and (np.diff(angle) <= 0.0).all())
    calm = falls and bool(points.position_error[-1] <= points.position_error[0])
    figures = {"[mm]": (1e3 * position).tolist(), "[rad]": angle.tolist()}
    return Finding(sound(runs, Q7Q8, BLOCKED) and calm, figures)


def smallest_eigenvalue(runs: Runs) -> Finding:
    """Smallest real parts along the path."""
    least = spectra(runs, Q7Q8, **BLOCKED)[:, 0]
    size = float(np.median(np.abs(least)))
    holds = 1e-15 < size < 1e-13 and bool(least.min() < 0.0 < least.max())
    return Finding(holds, {"median size [m²]": size})


def largest_eigenvalue(runs: Runs) -> Finding:
    """Largest real parts along the path."""
    most = spectra(runs, Q7Q8, **BLOCKED)[:, -1]
    return Finding(None, {"[m²]": [float(most.min()), float(most.max())]})


def delicate_by_the_zero(runs: Runs) -> Finding:
    """Eigenvalues that vanish at every point say nothing of the path: rank 6 of 8 leaves two of them."""
    real = np.concatenate([spectra(runs, Q1), spectra(runs, Q7Q8, **BLOCKED)])
    vanishing = (np.abs(real) < 1e-9).sum(axis=1)
    slowest = 1.0 / (5e-4 * real[:, 2].min())
    figures = {"vanishing": [int(vanishing.min()), int(vanishing.max())], "slowest decay [steps]": slowest}
    return Finding(not bool((vanishing == 2).all()), figures)


CONTRACTION: Variant = {"deformation": "contraction"}
NONE: Variant = {"counter_rotation": "none"}
TASK: Variant = {"counter_rotation": "task"}


def counter_rotation(runs: Runs) -> Finding:
    """Whether anything gets worse without 𝒩, in either reading and with either iteration."""
    figures = errors_of_variants(runs, {}, TASK, NONE, CONTRACTION, {**CONTRACTION, **NONE})
    pairs = {"8×8": (NONE, {}), "12×12": (NONE, TASK), "eq. 2.9": ({**CONTRACTION, **NONE}, CONTRACTION)}
    return Finding({name: not no_worse(runs, *pair) for name, pair in pairs.items()}, figures)


def twelve_dimensions(runs: Runs) -> Finding:
    """Errors with 𝒩 in the task's 12 dimensions and in joint space."""
    return Finding(None, errors_of_variants(runs, TASK, {}))


def dinevas_iteration(runs: Runs) -> Finding:
    """Errors with eq. 2.9 and with eq. 3.16."""
    return Finding(no_worse(runs, CONTRACTION, {}), errors_of_variants(runs, CONTRACTION, {}))


def j_prev_a(runs: Runs) -> Finding:
    """Errors with J̃ held during a point, and with J̃ of each inner step."""
    held: Variant = {"jacobian": "point"}
    return Finding(no_worse(runs, held, {}), errors_of_variants(runs, held, {}))


def no_inversion(runs: Runs) -> Finding:
    """Counted by hand in eq. 3.16 and the listing of AdaptiveDeform: products and norms only."""
    del runs
    factorisations = 0
    return Finding(factorisations == 0, {"factorisations": factorisations, "Jacobians": 1, "measured poses": 1})


def _compensates(runs: Runs, error: str, unit: str) -> Finding:
    """Errors compared with those of the exact arm that is driven by the model's joint coordinates."""
    holds, figures = dict[str, bool](), dict[str, list[float]]()
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
    return Finding(holds, in_unit(figures, unit))


def compensates_position(runs: Runs) -> Finding:
    """Position errors."""
    return _compensates(runs, "position", "mm")


def compensates_orientation(runs: Runs) -> Finding:
    """Orientation errors."""
    return _compensates(runs, "angle", "rad")


def precise_model(runs: Runs) -> Finding:
    """Errors with an exact model compared with those with the approximate one."""
    figures: dict[str, list[float]] = {}
    holds = True
    for name, path in PATHS.items():
        scenario = runs.scenario(path)
        exact = scenario.replace(arm=scenario.model, model=scenario.model)
        precise, other = errors(runs, exact), errors(runs, path)
        holds &= sound(runs, exact, {}) and not precise.worse(other)
        figures |= both(name, precise, other)
    return Finding(holds, figures)


def no_exploration(runs: Runs) -> Finding:
    """Shares of the steps in which one joint moves alone, each other one at less than 1 % of its speed.

    The investigation of each direction would take such steps.
    """
    shares = {}
    for name in (METHOD, *CLOSED_LOOPS):
        *_, second, fastest = np.sort(np.abs(runs.play(Q7Q8, name).qdot), axis=1).T
        shares[name] = float((second < SAME * fastest).mean())
    holds = {
        "the method": shares[METHOD] == 0.0,
        "against inversion": all(shares[name] > shares[METHOD] for name in CLOSED_LOOPS),
    }
    return Finding(holds, in_unit(shares, "%"))


def less_hectic(runs: Runs) -> Finding:
    """Peak joint velocities and travel compared with two closed loops."""
    peaks = {name: peak_speed(runs.play(Q7Q8, name)) for name in (METHOD, *CLOSED_LOOPS)}
    return Finding(all(peaks[METHOD] < peaks[name] for name in CLOSED_LOOPS), in_unit(peaks, "rad/s"))


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
    return Finding(holds, in_unit(figures, "mm"))


def needs_precise_measurement(runs: Runs) -> Finding:
    """Whether an error grows with noise in the measured pose."""
    path, holds, figures = three_seconds(runs), dict[str, bool](), dict[str, list[float]]()
    plants = (Plant(), *(Plant(pose_noise=size, pose_rotation_noise=size) for size in DEVIATIONS))
    for how, variant in LAMBDAS.items():
        exact, *noisy = settled = [errors(runs, path.replace(plant=plant), **variant) for plant in plants]
        holds |= {f"{1e3 * size:g} mm, {how}": e.worse(exact) for size, e in zip(DEVIATIONS, noisy, strict=True)}
        figures |= both(how, *settled)
    return Finding(holds, figures)
