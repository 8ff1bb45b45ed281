"""Faitli and Tar 2018: the tests of the claims in ``claims.toml``, each function named after its claim."""

from __future__ import annotations

import itertools

import numpy as np

from baselines.papers.comparisons import SAME, YANK, extent, largest_error, rms, sign_changes
from baselines.papers.faitli.episodes import (
    REGULAR,
    SHOULDER,
    STRETCHED,
    TRAJECTORIES,
    jacobians,
    play_method,
    real_zeros,
    short,
    singular_places,
    singular_values,
    with_end_point,
    yank,
)
from baselines.papers.paper import Finding, in_unit
from baselines.papers.runs import Runs, nominal_joints, times
from baselines.papers.varga.episodes import FAST, SLOW, nominal_angles
from baselines.registry import make
from ikgym.validation import FloatArray


def accurate_tracking(runs: Runs) -> Finding:
    """Largest error as a share of the path's extent."""
    shares = {
        short(name): largest_error(play_method(runs, name)) / extent(runs.scenario(name).nominal())
        for name in TRAJECTORIES
    }
    return Finding(max(shares.values()) < SAME, in_unit(shares, "%"))


def accurate_in_singularities(runs: Runs) -> Finding:
    """Largest error in the quarter of the path with the smallest singular values, as a share of the extent."""
    shares: dict[str, float] = {}
    for name in (STRETCHED, SHOULDER):
        scenario, error = runs.scenario(name), play_method(runs, name).position_error
        smallest = singular_values(jacobians(scenario, nominal_joints(scenario)))[:, -1]
        near = smallest < np.quantile(smallest, 0.25)
        shares[short(name)] = float(error[near].max()) / extent(runs.scenario(name).nominal())
    return Finding(max(shares.values()) < SAME, in_unit(shares, "%"))


def _separation(runs: Runs, name: str, q: FloatArray) -> FloatArray:
    """The largest distance of a joint coordinate from its nominal one in [rad]. Shape (steps,)."""
    out: FloatArray = np.abs(q - nominal_joints(runs.scenario(name))).max(axis=1)
    return out


def other_joint_coordinates(runs: Runs) -> Finding:
    """Largest distance of the joint paths."""
    apart = float(_separation(runs, STRETCHED, play_method(runs).q).max())
    nominal = nominal_joints(runs.scenario(STRETCHED))
    return Finding(apart > 0.1 * np.ptp(nominal, axis=0).max(), {"[rad]": apart})


def separation_at_singularities(runs: Runs) -> Finding:
    """Time between a singular point and the separation of the joint paths."""
    scenario = runs.scenario(STRETCHED)
    time, nominal = times(scenario), nominal_joints(scenario)
    regular = float(_separation(runs, REGULAR, play_method(runs, REGULAR).q).max())
    apart = _separation(runs, STRETCHED, play_method(runs).q)
    passes = time[sign_changes(np.linalg.det(jacobians(scenario, nominal)))]
    begin = float(time[int(np.argmax(apart > 10.0 * regular))])
    gap = float(np.abs(passes - begin).min()) if len(passes) else np.inf
    figures = {"from [s]": begin, "gap [s]": gap, "at most [rad]": float(apart.max()), "regular [rad]": regular}
    return Finding(bool(apart.max() > 10.0 * regular and gap < 0.1), figures)


def zero_eigenvalues(runs: Runs) -> Finding:
    """Singular points passed: sign changes of det J along the calculated joint path, then along the nominal one."""
    counts: dict[str, list[float]] = {}
    for name in TRAJECTORIES:
        scenario = runs.scenario(name)
        paths = play_method(runs, name).q, nominal_joints(scenario)
        counts[short(name)] = [len(sign_changes(np.linalg.det(jacobians(scenario, q)))) for q in paths]
    return Finding({name: calculated > 1 for name, (calculated, _) in counts.items()}, counts)


def real_part_zero_is_singular(runs: Runs) -> Finding:
    """Zeros of a real part at which J is regular: a conjugate pair of eigenvalues crosses the imaginary axis there."""
    regular: dict[str, float] = {}
    for name in TRAJECTORIES:
        jacobian = jacobians(runs.scenario(name), play_method(runs, name).q)
        smallest = singular_values(jacobian[real_zeros(jacobian)])[:, -1]
        regular[short(name)] = int((smallest > 0.01).sum())
    return Finding(max(regular.values()) == 0, regular)


def end_point_of_link_2(runs: Runs) -> Finding:
    """Largest distance of the joint paths, without and with the end point: A = -1, and A sure to contract."""
    figures = {}
    for name in TRAJECTORIES:
        paths = [play_method(runs, name).q, *(with_end_point(runs.scenario(name), a) for a in (-1.0, None))]
        figures[short(name)] = [float(_separation(runs, name, path).max()) for path in paths]
    holds = all(max(extended) < plain for plain, *extended in figures.values())
    return Finding(holds, in_unit(figures, "mrad"))


def d_is_a_parameter(runs: Runs) -> Finding:
    """Joint paths with other values of D, which differ by rounding."""
    paths = [play_method(runs, d=d).q for d in (0.3, 0.0, -2.0, 5.0)]
    apart = max(float(np.abs(q - paths[0]).max()) for q in paths[1:])
    return Finding(apart > 1e-4, {"[rad]": apart})


def a_decides_convergence(runs: Runs) -> Finding:
    """Largest error with values of A within and beyond the bound."""
    scenario = runs.scenario(REGULAR)
    bound = 4.0 / float(singular_values(jacobians(scenario, nominal_joints(scenario))).max() ** 2)
    errors = {a: largest_error(play_method(runs, REGULAR, a=a)) for a in (0.1, -0.1, -1.0, -2.0, -3.0)}
    good = {a: e for a, e in errors.items() if -bound < a < 0.0}
    bad = {a: e for a, e in errors.items() if a not in good}
    figures = in_unit({"": list(errors.values())}, "mm")
    return Finding(min(bad.values()) > max(good.values()), figures)


def transpose_helps_convergence(runs: Runs) -> Finding:
    """Largest error with Jᵀ, and without it with the best A."""
    figures = {}
    for name in TRAJECTORIES:
        without = [play_method(runs, name, transformation="none", a=a) for a in (-1.0, -0.1, 0.1, 1.0)]
        figures[short(name)] = largest_error(play_method(runs, name)), min(map(largest_error, without))
    return Finding(all(a < b for a, b in figures.values()), in_unit(figures, "mm"))


def not_square(runs: Runs) -> Finding:
    """Largest errors with 7 joints and 6 task coordinates, as shares of the path's extent and of its largest turn.

    The paper does not weigh position and orientation against each other: 1 rad counts as 1 m.
    """
    holds: dict[str, bool] = {}
    figures: dict[str, list[float]] = {}
    for path, iterations in itertools.product((SLOW, FAST), (10, 50)):
        episode, where = play_method(runs, path, length=1.0, iterations=iterations), f"{path}, {iterations}"
        position, angle = largest_error(episode), float(episode.orientation_error.max())
        of_extent = position / extent(runs.scenario(path).nominal()[:, 3:])
        of_turn = angle / float(nominal_angles(runs, path).max())
        holds |= {f"{where}, position": of_extent < SAME, f"{where}, orientation": of_turn < SAME}
        numbers = {"[mm]": 1e3 * position, "[rad]": angle}
        numbers |= {"of the extent [%]": 100.0 * of_extent, "of the turn [%]": 100.0 * of_turn}
        figures = {name: [*figures.get(name, []), value] for name, value in numbers.items()}
    return Finding(holds, figures)


def several_iterations(runs: Runs) -> Finding:
    """Error with 1, 10 and 100 iterations a grid point."""
    figures = {
        short(name): [rms(play_method(runs, name, iterations=n).position_error) for n in (1, 10, 100)]
        for name in TRAJECTORIES
    }
    return Finding(all(errors == sorted(errors, reverse=True) for errors in figures.values()), in_unit(figures, "mm"))


def no_inversion(runs: Runs) -> Finding:
    """Counted by hand in eq. 1: each iteration takes one Jacobian and multiplies by its transpose."""
    jacobians_of_a_step = int(make("fixed_point", runs.scenario(STRETCHED)).parameters["iterations"])
    factorisations = 0
    return Finding(factorisations == 0, {"factorisations": factorisations, "Jacobians a step": jacobians_of_a_step})


def no_yanks(runs: Runs) -> Finding:
    """Peak joint velocity over the median of the fastest joint's, where inversion yanks."""
    multiples = {}
    for scenario in singular_places(runs):
        inversion, method = runs.play(scenario, "moore_penrose"), play_method(runs, scenario)
        multiples[short(scenario.name)] = yank(inversion), yank(method)
    yanked = [method for inversion, method in multiples.values() if inversion > YANK]
    return Finding(bool(yanked) and max(yanked) <= YANK, multiples)


def easy_to_set(runs: Runs) -> Finding:
    """A judgement."""
    del runs
    return Finding(None, {})
