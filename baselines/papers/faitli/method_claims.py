"""Faitli and Tar 2018, sections 1 and 2.2: what is claimed of the method and of its parameters."""

from __future__ import annotations

import numpy as np

from baselines.papers.counts import count
from baselines.papers.faitli.episodes import (
    METHOD,
    REGULAR,
    STRETCHED,
    TRAJECTORIES,
    YANK,
    jacobians,
    nominal_joints,
    singular_places,
    singular_values,
    solved,
    speeds,
    yank,
)
from baselines.papers.paper import Claim, Finding, rms, verdict
from baselines.papers.runs import Runs
from baselines.status import Status


def _d_matters(runs: Runs) -> Finding:
    """Actions are float32, so that rounding of the sums with D can show in the last digit of an action."""
    paths = [solved(runs, d=d).q for d in (0.3, 0.0, -2.0, 5.0)]
    apart = max(float(np.abs(q - paths[0]).max()) for q in paths[1:])
    return verdict(
        apart > 1e-4,
        f"joint paths with D = 0, -2 and 5 differ from that with 0.3 by at most {apart:.1e} rad, the rounding of "
        "F(A ‖h‖ + ξ*) - ξ* = A ‖h‖ / 2, in which D cancels",
        largest_difference_rad=apart,
    )


def _a_matters(runs: Runs) -> Finding:
    scenario = runs.scenario(REGULAR)
    bound = 4.0 / float(singular_values(jacobians(scenario, nominal_joints(scenario))).max() ** 2)
    errors = {a: float(solved(runs, REGULAR, a=a).position_error.max()) for a in (0.1, -0.1, -1.0, -2.0, -3.0)}
    good = {a: e for a, e in errors.items() if -bound < a < 0.0}
    bad = {a: e for a, e in errors.items() if a not in good}
    parts = [f"{1e3 * e:.3g} mm with A = {a:g}" for a, e in errors.items()]
    return verdict(
        min(bad.values()) > max(good.values()),
        f"largest error on `{REGULAR}` {', '.join(parts)}; -4/σ_max² = {-bound:.2f} there",
        bound=bound,
        **{f"A = {a:g}": e for a, e in errors.items()},
    )


def _transpose_helps(runs: Runs) -> Finding:
    numbers = {}
    for name in TRAJECTORIES:
        without = [solved(runs, name, transformation="none", a=a) for a in (-1.0, -0.1, 0.1, 1.0)]
        best = min(without, key=lambda episode: float(episode.position_error.max()))
        numbers[name] = {
            "with_m": float(solved(runs, name).position_error.max()),
            "without_m": float(best.position_error.max()),
            "diverged_without": float((best.status == Status.DIVERGED).mean()),
        }
    parts = [
        f"`{name}` {1e3 * v['with_m']:.1f} mm with, {v['without_m']:.2f} m without ({v['diverged_without']:.0%} of the "
        "steps diverged)"
        for name, v in numbers.items()
    ]
    holds = all(v["without_m"] > v["with_m"] for v in numbers.values())
    return verdict(holds, f"largest error {'; '.join(parts)}, the best of A = ±0.1 and ±1", **numbers)


def _not_square(runs: Runs) -> Finding:
    name = "varga7-slow"
    episode = solved(runs, name, length=1.0)  # the paper weighs nothing
    position, angle = float(episode.position_error.max()), float(episode.orientation_error.max())
    lost = float((episode.status == Status.DIVERGED).mean())
    return verdict(
        lost == 0.0,
        f"7 joints, 6 task coordinates: no step diverged, largest errors {1e3 * position:.1f} mm and {angle:.4f} rad"
        if lost == 0.0
        else f"{lost:.0%} of the steps diverged",
        largest_position_error_m=position,
        largest_orientation_error_rad=angle,
    )


def _several_iterations(runs: Runs) -> Finding:
    counts = (1, 10, 100)
    numbers = {name: [rms(solved(runs, name, iterations=n).position_error) for n in counts] for name in TRAJECTORIES}
    parts = [f"`{n}` {', '.join(f'{1e3 * e:.2g}' for e in errors)} mm" for n, errors in numbers.items()]
    return verdict(
        all(errors == sorted(errors, reverse=True) for errors in numbers.values()),
        f"root mean square of the error with 1, 10, 100 iterations: {'; '.join(parts)}",
        **numbers,
    )


def _inversion_free(runs: Runs) -> Finding:
    del runs
    steps = [step for name in TRAJECTORIES for step in count(name, METHOD)]
    factorisations = sum(step.factorisations for step in steps)
    jacobian = float(np.mean([step.jacobians for step in steps]))
    other = float(np.mean([step.factorisations for step in count(STRETCHED, "moore_penrose")]))
    return verdict(
        factorisations == 0,
        f"counted call by call in {len(steps)} steps: {factorisations} factorisations or inversions, {jacobian:.0f} "
        f"Jacobians a step; the pseudoinverse needs {other:.0f} factorisation a step",
        factorisations=factorisations,
        jacobians_per_step=jacobian,
    )


def _no_yanks(runs: Runs) -> Finding:
    """Where inversion does not yank there is nothing to be avoided."""
    numbers = {}
    for scenario in singular_places(runs):
        episodes = {"method": solved(runs, scenario), "pseudoinverse": runs.play(scenario, "moore_penrose")}
        numbers[scenario.name] = {
            **{f"{name}_rad_per_s": float(speeds(e).max()) for name, e in episodes.items()},
            **{f"{name}_multiple": yank(e) for name, e in episodes.items()},
            "method_error_m": float(episodes["method"].position_error.max()),
        }
    parts = [
        f"`{name}` {v['pseudoinverse_rad_per_s']:.3g} rad/s ({v['pseudoinverse_multiple']:.2g} × the median), "
        f"without {v['method_rad_per_s']:.2f} rad/s ({v['method_multiple']:.2g} ×), error up to "
        f"{1e3 * v['method_error_m']:.1f} mm"
        for name, v in numbers.items()
    ]
    yanked = {name: v["method_multiple"] for name, v in numbers.items() if v["pseudoinverse_multiple"] > YANK}
    return verdict(
        bool(yanked) and max(yanked.values()) <= YANK,
        f"peak joint velocity with inversion {'; '.join(parts)}: inversion yanks at {len(yanked)} of {len(numbers)} "
        "places; the stretched elbow is crossed by a path that needs no great velocities",
        places=numbers,
    )


def _easy(runs: Runs) -> Finding:
    del runs
    return Finding("not testable", "a judgement; of A, D and F only A F'(ξ*) acts, and 4/σ_max² bounds it", {})


CLAIMS = (
    Claim(
        "D is a parameter",
        "D = 0.3 is one of the parameters that the simulation requires.",
        "section 2.2, table 1",
        f"joint paths on `{STRETCHED}` with other values of D",
        _d_matters,
    ),
    Claim(
        "A decides convergence",
        "A is important to guarantee convergence; it is usually a small, signed value.",
        "section 1.1",
        "largest error with values of A within and beyond the bound -4/σ_max² < A < 0: any beyond above any within",
        _a_matters,
    ),
    Claim(
        "Jᵀ helps convergence",
        "The transposed Jacobian, x̃ = Jᵀ f(q), is conducive to convergence.",
        "section 1.1",
        "largest error with `transformation` `transpose` and `none`",
        _transpose_helps,
    ),
    Claim(
        "not square",
        "With Jᵀ there are no further problems when the Jacobian is not quadratic.",
        "section 1.1",
        "`fixed_point` on `varga7-slow`, with 1 rad counted as 1 m",
        _not_square,
    ),
    Claim(
        "several iterations",
        "After several iterations the sequence gets close to the fixed point.",
        "section 1.1",
        "error with 1, 10 and 100 iterations per grid point, which must fall",
        _several_iterations,
    ),
    Claim(
        "no inversion",
        "The method does not include a matrix inversion.",
        "abstract, section 1",
        "operations of a step, counted call by call in a few steps",
        _inversion_free,
    ),
    Claim(
        "no yanks",
        "Inversion can cause rapid, yank-like movement at singularities; without it the difficulties are avoided.",
        "section 1",
        "peak joint velocity of `moore_penrose` and `fixed_point` on both trajectories with singular points, and on "
        "straight lines past the shoulder axis without velocity limit; a yank is a peak above 10 times the median over "
        "time; wherever inversion yanks the method must not",
        _no_yanks,
    ),
    Claim(
        "easy to set",
        "It is implemented easily, and its parameters are set relatively fast.",
        "section 3",
        "not tested",
        _easy,
    ),
)
