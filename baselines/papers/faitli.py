"""Faitli and Tar 2018: inverse kinematics by a quasi-differential fixed-point transformation."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.ticker import MaxNLocator

from baselines.papers.drawing import Curve, Panel, picture
from baselines.papers.paper import Claim, Drawn, Finding, Paper, PaperFigure
from baselines.papers.runs import Runs
from baselines.plots import style
from baselines.rollout import Episode
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

STRETCHED, REGULAR, SHOULDER = "faitli3-stretched", "faitli3-regular", "faitli3-shoulder"
TRAJECTORIES = (STRETCHED, REGULAR, SHOULDER)
METHOD = "fixed_point"
LABELS = ("x", "y", "z")


def solved(runs: Runs, name: str = STRETCHED, **parameters: Any) -> Episode:
    """The paper's method, with the parameters of its Table 1 unless others are given."""
    return runs.play(name, METHOD, **parameters)


def jacobians(scenario: Scenario, q: FloatArray) -> FloatArray:
    """The 3×3 position Jacobians (eq. 3) in [m]. Shape (k, 3, 3)."""
    return scenario.arm.jacobian(q)[:, :3]


def singular_values(jacobian: FloatArray) -> FloatArray:
    """From the largest to the smallest, in [m]. Shape (k, 3)."""
    return np.asarray(np.linalg.svd(jacobian, compute_uv=False), dtype=np.float64)


def sign_changes(values: FloatArray) -> npt.NDArray[np.intp]:
    """Numbers of the steps after which values change their sign. Shape (c,)."""
    return np.flatnonzero(np.diff(np.sign(values)))


def _times(scenario: Scenario) -> FloatArray:
    return scenario.times(scenario.steps + 1)[1:]


def _nominal_joints(scenario: Scenario) -> FloatArray:
    path = scenario.nominal_joint_path()
    if path is None:
        raise InvalidInputError(f"scenario {scenario.name!r} has no joint path to compare with.")
    return path[1:]


def _separation(runs: Runs, name: str, episode: Episode) -> FloatArray:
    """The largest distance of a joint coordinate from its nominal one in [rad]. Shape (steps,)."""
    out: FloatArray = np.abs(episode.q - _nominal_joints(runs.scenario(name))).max(axis=1)
    return out


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _path(runs: Runs) -> Drawn:
    scenario, episode = runs.scenario(STRETCHED), solved(runs)
    nominal = scenario.nominal()[1:]
    figure = style.figure(4.8)
    axes = figure.add_subplot(projection="3d")
    handles: list[Artist] = []
    looks = {"calculated": (episode.pose, "-", 1.2), "nominal": (nominal, (0, (4, 2)), 1.8)}
    for number, (points, line, width) in enumerate(looks.values()):
        handles += axes.plot(*points.T, color=style.looks(number)["color"], linestyle=line, lw=width)
    for label, name in zip(("xlabel", "ylabel", "zlabel"), LABELS, strict=True):
        axes.set(**{label: f"{name} [m]"})
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(4))
    axes.tick_params(labelsize=style.SMALL, pad=1)
    axes.view_init(elev=24.0, azim=-38.0)
    axes.set_box_aspect(np.maximum(np.ptp(nominal, axis=0), 0.1), zoom=0.95)
    style.legend(figure, "Nominal and calculated path of the tool", handles, list(looks))
    return Drawn(
        figure,
        {
            "largest_error_m": float(episode.position_error.max()),
            "extent_m": np.ptp(nominal, axis=0).tolist(),
        },
    )


def _error(runs: Runs) -> Drawn:
    scenario, episode = runs.scenario(STRETCHED), solved(runs)
    time, error = _times(scenario), scenario.nominal()[1:] - episode.pose
    components = [Curve(label, time, 1e3 * error[:, i]) for i, label in enumerate(LABELS)]
    length = [Curve("length", time, 1e3 * episode.position_error)]
    return Drawn(
        picture(
            "Tracking error, nominal less calculated",
            [Panel("error [mm]", components), Panel("error [mm]", length, log=True)],
            height=2.6,
        ),
        {
            "largest_error_m": float(episode.position_error.max()),
            "rms_error_m": _rms(episode.position_error),
            "largest_component_error_m": np.abs(error).max(axis=0).tolist(),
        },
    )


def _joint(runs: Runs, joint: int) -> Drawn:
    scenario, episode = runs.scenario(STRETCHED), solved(runs)
    time, nominal = _times(scenario), _nominal_joints(scenario)[:, joint]
    curves = [
        Curve("calculated", time, episode.q[:, joint]),
        Curve("nominal", time, nominal, dashed=True),
    ]
    title = f"$q_{joint + 1}$, nominal and calculated"
    return Drawn(
        picture(title, [Panel(f"$q_{joint + 1}$ [rad]", curves)], height=3.2),
        {"largest_separation_rad": float(np.abs(episode.q[:, joint] - nominal).max())},
    )


def _eigenvalues(runs: Runs) -> Drawn:
    scenario, episode = runs.scenario(STRETCHED), solved(runs)
    time, panels, singular, numbers = _times(scenario), [], [], {}
    for label, q in {"calculated": episode.q, "nominal": _nominal_joints(scenario)}.items():
        jacobian = jacobians(scenario, q)
        real = np.sort(np.linalg.eigvals(jacobian).real, axis=1)
        smallest = singular_values(jacobian)[:, -1]
        order = {"smallest": 0, "largest": 2, "middle": 1}  # the dashed line last, as pairs lie upon each other
        curves = [Curve(name, time, real[:, i], dashed=i == 1) for name, i in order.items()]
        panels.append(Panel("real part of the\neigenvalues [m]", curves, title=f"{label} joint path"))
        singular.append(Curve(f"{label} joint path", time, smallest, dashed=label == "nominal"))
        numbers[label] = {
            "singular_points": len(sign_changes(np.linalg.det(jacobian))),
            "zeros_of_a_real_part": len(_real_zeros(jacobian)),
            "smallest_singular_value_m": float(smallest.min()),
        }
    panels.append(Panel("smallest singular\nvalue [m]", singular, title="0 where the arm is singular"))
    return Drawn(picture("Real parts of the eigenvalues of the position Jacobian", panels, height=2.2), numbers)


def _real_zeros(jacobian: FloatArray) -> npt.NDArray[np.intp]:
    """Numbers of the steps after which a real part of an eigenvalue changes its sign."""
    real = np.sort(np.linalg.eigvals(jacobian).real, axis=1)
    return np.unique(np.concatenate([sign_changes(column) for column in real.T]))


FIGURES = (
    PaperFigure(2, "Nominal and calculated path of the tool", _path),
    PaperFigure(3, "Tracking error", _error),
    PaperFigure(4, "q2, nominal and calculated", lambda r: _joint(r, 1)),
    PaperFigure(5, "q3, nominal and calculated", lambda r: _joint(r, 2)),
    PaperFigure(6, "Real parts of the eigenvalues of the position Jacobian", _eigenvalues),
)


def _verdict(holds: bool, evidence: str, **numbers: Any) -> Finding:
    return Finding("reproduced" if holds else "contradicted", evidence, numbers)


def _accurate(runs: Runs) -> Finding:
    """In the plot of a path, what is below a hundredth of its extent is the width of the line."""
    shares, parts = {}, []
    for name in TRAJECTORIES:
        extent = float(np.linalg.norm(np.ptp(runs.scenario(name).nominal(), axis=0)))
        largest = float(solved(runs, name).position_error.max())
        shares[name] = largest / extent
        parts.append(f"{1e3 * largest:.1f} mm, {largest / extent:.2%} of the extent, on `{name}`")
    return _verdict(max(shares.values()) < 0.01, f"largest error {'; '.join(parts)}", **shares)


def _near_singularities(runs: Runs) -> Finding:
    numbers = {}
    for name in (STRETCHED, SHOULDER):
        scenario, error = runs.scenario(name), solved(runs, name).position_error
        smallest = singular_values(jacobians(scenario, _nominal_joints(scenario)))[:, -1]
        near = smallest < np.quantile(smallest, 0.25)
        numbers[name] = {"rms_near_m": _rms(error[near]), "rms_far_m": _rms(error[~near])}
    parts = [
        f"`{name}` {1e3 * v['rms_near_m']:.2f} mm near, {1e3 * v['rms_far_m']:.2f} mm elsewhere"
        for name, v in numbers.items()
    ]
    more = ", ".join(f"{1e3 * solved(runs, iterations=n).position_error.max():.1f} mm with {n}" for n in (1, 10, 100))
    return Finding(
        "not testable",
        f"no number is given; root mean square of the error: {'; '.join(parts)}; largest error on `{STRETCHED}`: "
        f"{more} iterations",
        numbers,
    )


def _somewhat(runs: Runs) -> Finding:
    apart = float(_separation(runs, STRETCHED, solved(runs)).max())
    nominal = _nominal_joints(runs.scenario(STRETCHED))
    tool = float(solved(runs).position_error.max())
    return _verdict(
        apart > 0.1 * np.ptp(nominal, axis=0).max(),
        f"up to {apart:.2f} rad between the joint paths, with the tool within {1e3 * tool:.1f} mm",
        largest_separation_rad=apart,
    )


def _separate(runs: Runs) -> Finding:
    scenario = runs.scenario(STRETCHED)
    time, nominal = _times(scenario), _nominal_joints(scenario)
    regular = float(_separation(runs, REGULAR, solved(runs, REGULAR)).max())
    apart = _separation(runs, STRETCHED, solved(runs))
    passes = time[sign_changes(np.linalg.det(jacobians(scenario, nominal)))]
    begin = float(time[int(np.argmax(apart > 10.0 * regular))])
    gap = float(np.abs(passes - begin).min()) if len(passes) else np.inf
    return _verdict(
        apart.max() > 10.0 * regular and gap < 0.1,
        f"on `{REGULAR}` they stay within {1e3 * regular:.0f} mrad; on `{STRETCHED}` they part by more than ten times "
        f"that from {begin:.2f} s on, {gap:.2f} s from a singular point of the nominal path, and by "
        f"{apart.max():.2f} rad at most",
        regular_rad=regular,
        stretched_rad=float(apart.max()),
        begin_s=begin,
        gap_s=gap,
    )


def _rejoin(runs: Runs) -> Finding:
    numbers = {}
    for name in TRAJECTORIES:
        plain, longer = solved(runs, name), runs.play(name, "fixed_point_extended")
        numbers[name] = {
            "plain_rad": float(_separation(runs, name, plain).max()),
            "extended_rad": float(_separation(runs, name, longer).max()),
        }
    parts = [f"{v['plain_rad']:.3g} rad → {v['extended_rad']:.2g} rad on `{n}`" for n, v in numbers.items()]
    holds = all(v["extended_rad"] < v["plain_rad"] for v in numbers.values())
    return _verdict(holds, f"largest distance from the nominal joint path {'; '.join(parts)}", **numbers)


def _zero_eigenvalues(runs: Runs) -> Finding:
    numbers = {}
    for name in TRAJECTORIES:
        scenario = runs.scenario(name)
        paths = {"calculated": solved(runs, name).q, "nominal": _nominal_joints(scenario)}
        numbers[name] = {label: len(sign_changes(np.linalg.det(jacobians(scenario, q)))) for label, q in paths.items()}
    parts = [f"`{n}` {v['nominal']} nominal, {v['calculated']} calculated" for n, v in numbers.items()]
    return _verdict(
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
        zeros = _real_zeros(jacobian)
        smallest = singular_values(jacobian[zeros])[:, -1]
        false = smallest[smallest > 0.01]
        numbers[name] = {"zeros": len(zeros), "of_full_rank": len(false)}
        parts.append(
            f"`{name}` {len(zeros)} zeros of a real part, {len(false)} of them where the Jacobian is regular"
            + (f" (smallest singular value from {false.min():.2f} m)" if len(false) else "")
        )
        sound = sound and len(false) == 0
    pair = "" if sound else ": a conjugate pair crosses the imaginary axis there"
    return _verdict(sound, f"{'; '.join(parts)}{pair}", **numbers)


def _d_matters(runs: Runs) -> Finding:
    """Actions are float32, so that rounding of the sums with D can show in the last digit of an action."""
    paths = [solved(runs, d=d).q for d in (0.3, 0.0, -2.0, 5.0)]
    apart = max(float(np.abs(q - paths[0]).max()) for q in paths[1:])
    return _verdict(
        apart > 1e-4,
        f"joint paths with D = 0, -2 and 5 differ from that with 0.3 by at most {apart:.1e} rad, the rounding of "
        "F(A ‖h‖ + ξ*) - ξ* = A ‖h‖ / 2, in which D cancels",
        largest_difference_rad=apart,
    )


def _a_matters(runs: Runs) -> Finding:
    scenario = runs.scenario(REGULAR)
    bound = 4.0 / float(singular_values(jacobians(scenario, _nominal_joints(scenario))).max() ** 2)
    errors = {a: float(solved(runs, REGULAR, a=a).position_error.max()) for a in (0.1, -0.1, -1.0, -2.0, -3.0)}
    good = {a: e for a, e in errors.items() if -bound < a < 0.0}
    bad = {a: e for a, e in errors.items() if a not in good}
    parts = [f"{1e3 * e:.3g} mm with A = {a:g}" for a, e in errors.items()]
    return _verdict(
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
    return _verdict(holds, f"largest error {'; '.join(parts)}, the best of A = ±0.1 and ±1", **numbers)


def _not_square(runs: Runs) -> Finding:
    name = "varga7-slow"
    episode = solved(runs, name)
    position, angle = float(episode.position_error.max()), float(episode.orientation_error.max())
    lost = float((episode.status == Status.DIVERGED).mean())
    return _verdict(
        lost == 0.0,
        f"7 joints, 6 task coordinates: no step diverged, largest errors {1e3 * position:.1f} mm and {angle:.4f} rad"
        if lost == 0.0
        else f"{lost:.0%} of the steps diverged",
        largest_position_error_m=position,
        largest_orientation_error_rad=angle,
    )


def _several_iterations(runs: Runs) -> Finding:
    counts = (1, 10, 100)
    numbers = {name: [_rms(solved(runs, name, iterations=n).position_error) for n in counts] for name in TRAJECTORIES}
    parts = [f"`{n}` {', '.join(f'{1e3 * e:.2g}' for e in errors)} mm" for n, errors in numbers.items()]
    return _verdict(
        all(errors == sorted(errors, reverse=True) for errors in numbers.values()),
        f"root mean square of the error with 1, 10, 100 iterations: {'; '.join(parts)}",
        **numbers,
    )


def _inversion_free(runs: Runs) -> Finding:
    episodes = [solved(runs, name) for name in TRAJECTORIES]
    factorisations = int(sum(e.operations.factorisations.sum() for e in episodes))
    jacobian = float(np.mean([e.operations.jacobians.mean() for e in episodes]))
    other = float(runs.play(STRETCHED, "moore_penrose").operations.factorisations.mean())
    return _verdict(
        factorisations == 0,
        f"{factorisations} factorisations or inversions in {sum(len(e.q) for e in episodes)} steps, {jacobian:.0f} "
        f"Jacobians a step; the pseudoinverse needs {other:.0f} factorisation a step",
        factorisations=factorisations,
        jacobians_per_step=jacobian,
    )


def _no_yanks(runs: Runs) -> Finding:
    numbers = {}
    for name in (STRETCHED, SHOULDER):
        scenario = runs.scenario(name)
        nominal = np.abs(np.diff(_nominal_joints(scenario), axis=0)) / scenario.dt
        numbers[name] = {
            "method": float(np.abs(solved(runs, name).qdot).max()),
            "pseudoinverse": float(np.abs(runs.play(name, "moore_penrose").qdot).max()),
            "nominal": float(nominal.max()),
        }
    parts = [
        f"`{n}` {v['method']:.2f} rad/s against {v['pseudoinverse']:.2f} rad/s of the pseudoinverse and "
        f"{v['nominal']:.2f} rad/s of the nominal path"
        for n, v in numbers.items()
    ]
    return _verdict(
        all(v["method"] < v["pseudoinverse"] for v in numbers.values()),
        f"peak joint velocity {'; '.join(parts)}",
        **numbers,
    )


def _easy(runs: Runs) -> Finding:
    del runs
    return Finding("not testable", "a judgement; of A, D and F only A F'(ξ*) acts, and 4/σ_max² bounds it", {})


CLAIMS = (
    Claim(
        "accurate tracking",
        "It is clearly visible that the tracking of the Cartesian coordinates is fairly accurate.",
        "section 2.3, fig. 2 and 3",
        "largest error on the three trajectories, 10 iterations; visible is an error of 1 % of the path's extent",
        _accurate,
    ),
    Claim(
        "accurate in singularities",
        "Tracking is fairly accurate even in the kinematic singularities and nearby.",
        "section 3",
        "error in the quarter of the path with the smallest singular values, and elsewhere",
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
        "changes of sign of det J along the nominal and the calculated joint paths",
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
        "largest distance of the joint paths, `fixed_point` and `fixed_point_extended`",
        _rejoin,
    ),
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
        "largest error with values of A within and beyond the bound -4/σ_max² < A < 0",
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
        "`fixed_point` on `varga7-slow`",
        _not_square,
    ),
    Claim(
        "several iterations",
        "After several iterations the sequence gets close to the fixed point.",
        "section 1.1",
        "error with 1, 10 and 100 iterations per grid point",
        _several_iterations,
    ),
    Claim(
        "no inversion",
        "The method does not include a matrix inversion.",
        "abstract, section 1",
        "operation audit of the policies",
        _inversion_free,
    ),
    Claim(
        "no yanks",
        "Inversion can cause rapid, yank-like movement at singularities; without it the difficulties are avoided.",
        "section 1",
        "peak joint velocity on both trajectories with singular points, beside `moore_penrose`",
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

PAPER = Paper(
    "faitli",
    "Faitli, Tar 2018: quasi-differential fixed-point transformation",
    FIGURES,
    CLAIMS,
    readings=(
        "No trajectory is printed; figures are those of `faitli3-stretched`, which passes the stretched elbow six "
        "times, and `faitli3-regular` and `faitli3-shoulder` are tested besides.",
        "The iterations per grid point are not printed; 10 are made.",
        "Eq. 1 is printed for f(q) - x, the text recommends x̃ = Jᵀ f(q); figures are drawn with Jᵀ.",
        "Eq. 1 adds a vector of the Cartesian space to q, which fits with n = m only, and with Jᵀ always.",
        "With F(ξ) = ξ/2 + D the fixed point is ξ* = 2D, and the step is q + (A/2) Jᵀ(f(q) - x): D cancels.",
        "Figure 6 is drawn along the calculated and the nominal joint path, with the smallest singular value below, "
        "since a real part can be zero where no eigenvalue is.",
        "The end point of link 2 follows from the nominal joint path, as in the paper, which makes it in joint space.",
    ),
)
