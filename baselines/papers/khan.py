"""Khan and Tar 2020: adaptive inverse kinematics by abstract rotations, on an arm that is known imprecisely."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from baselines.papers.drawing import Curve, Panel, picture
from baselines.papers.faitli import STRETCHED, TRAJECTORIES
from baselines.papers.paper import Claim, Drawn, Finding, Paper, PaperFigure
from baselines.papers.runs import Runs
from baselines.registry import make
from baselines.rollout import Episode, rollout
from baselines.status import Status
from ikgym.rotations import rotation_vector
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

Q1, Q7Q8 = "khan8-q1", "khan8-q7q8"
METHOD = "abstract_rotation"
#: ℱ with the orientation's nine elements at ½; 𝒲 with the last two joints at 0.01.
LOOSE: dict[str, Any] = {"task_weights": (0.5,) * 9 + (1.0,) * 3}
BLOCKED: dict[str, Any] = {"joint_weights": (1.0,) * 6 + (0.01,) * 2}
START = 0.3  # [s] of the path in which the initial error relaxes
WEIGHTED = {"task_weights": "; F = 0.5 for the orientation", "joint_weights": "; W = 0.01 for joints 7 and 8"}
TRACKING, ERRORS, JOINTS, ANGLES = "Tracking", "Tracking errors", "Joint coordinates", "Angles of both rotations"
NOUGHT = 1e-9  # [m²]: an eigenvalue of J̃ᵀJ below this is rounding


class Points(NamedTuple):
    """What came of an episode at its grid points, each after the point's last inner step.

    Attributes:
        time: s in [s]. Shape (k,).
        nominal: Nominal task coordinates. Shape (k, 12).
        pose: Realised ones. Shape (k, 12).
        position_error: In [m]. Shape (k,).
        orientation_error: In [rad]. Shape (k,).
        q: Joint coordinates in [rad]. Shape (k, 8).
        inside: Angles of both rotations in [rad], by name; each of shape (k,).
    """

    time: FloatArray
    nominal: FloatArray
    pose: FloatArray
    position_error: FloatArray
    orientation_error: FloatArray
    q: FloatArray
    inside: dict[str, FloatArray]

    def settled(self, values: FloatArray) -> FloatArray:
        """Values from 1 s on, when the initial error is gone; all of them in a shorter trial."""
        late = values[self.time > 1.0]
        return late if len(late) else values


def at_points(runs: Runs, name: str, policy: str = METHOD, **parameters: Any) -> Points:
    """The episode of a policy, seen at the grid points."""
    return _points(runs.scenario(name), runs.play(name, policy, **parameters))


def _points(scenario: Scenario, episode: Episode) -> Points:
    last = scenario.counted()[1:]
    time = scenario.points()[1:][last] * scenario.dt
    return Points(
        np.asarray(time, dtype=np.float64),
        scenario.nominal()[1:][last],
        episode.pose[last],
        episode.position_error[last],
        episode.orientation_error[last],
        episode.q[last],
        {name: values[last] for name, values in episode.inside.items()},
    )


def spectra(runs: Runs, name: str, **parameters: Any) -> FloatArray:
    """Real parts of the eigenvalues of J̃ᵀJ in [m²] along the path, rising; J̃ of the model, J of the arm. Shape (k, 8).

    The orientation's numbers count as [m] as they do in the method.
    """
    scenario, q = runs.scenario(name), at_points(runs, name, **parameters).q
    model, arm = (
        scenario.task.jacobian(rotation, geometric)
        for rotation, _, geometric in (a.forward_and_jacobian(q) for a in (scenario.model, scenario.arm))
    )
    return np.sort(np.linalg.eigvals(np.swapaxes(model, 1, 2) @ arm).real, axis=1)


def turned(pose: FloatArray) -> FloatArray:
    """Rotation vectors from the home orientation, in [rad], of task coordinates. Shape (k, 3)."""
    return np.array([rotation_vector(rotation) for rotation in pose[:, :9].reshape(-1, 3, 3)])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _errors(points: Points) -> dict[str, float]:
    """The settled errors in numbers."""
    position, angle = points.settled(points.position_error), points.settled(points.orientation_error)
    return {
        "rms_position_error_m": _rms(position),
        "largest_position_error_m": float(position.max()),
        "rms_orientation_error_rad": _rms(angle),
        "largest_orientation_error_rad": float(angle.max()),
    }


def _tracking(title: str, points: Points) -> Drawn:
    real, nominal = (
        [*pose[:, 9:].T, np.sqrt(np.square(turned(pose)).sum(axis=1))] for pose in (points.pose, points.nominal)
    )
    labels = ("$X_1$ [m]", "$X_2$ [m]", "$X_3$ [m]", "rotation from\nhome [rad]")
    panels = [
        Panel(label, [Curve("realised", points.time, a), Curve("nominal", points.time, b, dashed=True)])
        for label, a, b in zip(labels, real, nominal, strict=True)
    ]
    return Drawn(
        picture(title, panels, columns=2, height=2.3),
        {
            **_errors(points),
            "nominal_extent_m": np.ptp(points.nominal[:, 9:], axis=0).tolist(),
            "realised_extent_m": np.ptp(points.settled(points.pose[:, 9:]), axis=0).tolist(),
        },
    )


def _error_figure(title: str, points: Points) -> Drawn:
    """The start by itself, since its error would flatten all that follows."""
    start = points.time <= START
    rest = ~start if not start.all() else start
    error = points.nominal[:, 9:] - points.pose[:, 9:]
    panels = []
    for kind, curves in {
        "end-point error [m]": {f"$X_{i + 1}$": error[:, i] for i in range(3)},
        "orientation error [rad]": {"angle": points.orientation_error},
    }.items():
        for part, what in ((start, f"the first {START} s"), (rest, "after that")):
            drawn = [Curve(name, points.time[part], values[part]) for name, values in curves.items()]
            panels.append(Panel(kind, drawn, title=what))
    return Drawn(
        picture(title, panels, columns=2, height=2.4),
        {
            **_errors(points),
            "first_position_error_m": float(points.position_error[0]),
            "first_orientation_error_rad": float(points.orientation_error[0]),
            "peak_orientation_error_rad": float(points.orientation_error.max()),
        },
    )


def _joints(runs: Runs, title: str, points: Points, name: str, other: Points | None = None) -> Drawn:
    """Each joint's path; in the runs with weights beside that without."""
    path = runs.scenario(name).nominal_joint_path()
    nominal = np.zeros_like(points.q) if path is None else path[1:][runs.scenario(name).counted()[1:]]
    panels = []
    for i in range(points.q.shape[1]):
        curves = [
            Curve("solution", points.time, points.q[:, i]),
            Curve("generated the nominal path", points.time, nominal[:, i], dashed=True),
        ]
        if other is not None:
            curves.append(Curve("solution without weights", points.time, other.q[:, i]))
        panels.append(Panel(f"$q_{i + 1}$ [rad]", curves))
    numbers = {"range_rad": np.ptp(points.q, axis=0).tolist(), "range_nominal_rad": np.ptp(nominal, axis=0).tolist()}
    if other is not None:
        numbers["largest_difference_rad"] = np.abs(points.q - other.q).max(axis=0).tolist()
    return Drawn(picture(title, panels, columns=2, height=1.6), numbers)


def _generator(runs: Runs) -> Drawn:
    scenario = runs.scenario(Q7Q8)
    path, time = scenario.nominal_joint_path(), at_points(runs, Q7Q8).time
    nominal = np.zeros((len(time), 8)) if path is None else path[1:][scenario.counted()[1:]]
    curves = [Curve(f"$q_{i + 1}$", time, nominal[:, i]) for i in (6, 7)]
    curves.append(Curve("$q_1$ … $q_6$", time, nominal[:, 0]))
    return Drawn(
        picture(
            "Joint coordinates that generate the nominal path", [Panel("joint coordinate [rad]", curves)], height=3
        ),
        {"range_rad": np.ptp(nominal, axis=0).tolist()},
    )


def _angles(title: str, points: Points) -> Drawn:
    panels, numbers = [], {}
    for name in ("counter_rotation", "abstract_rotation"):
        label = f"angle of the\n{name.replace('_rotation', ' rotation')} [rad]"
        angle = points.inside[f"angle_{name}"]
        panels.append(Panel(label, [Curve("after each grid point", points.time, angle)], log=True))
        late = points.settled(angle)
        numbers[name] = {"median_rad": float(np.nanmedian(late)), "largest_rad": float(np.nanmax(angle))}
    return Drawn(picture(title, panels, height=2.3), numbers)


def _spectrum(runs: Runs) -> Drawn:
    real, time = spectra(runs, Q7Q8, **BLOCKED), at_points(runs, Q7Q8, **BLOCKED).time
    panels = [
        Panel("smallest [m²]", [Curve("smallest real part", time, real[:, 0], dots=True)]),
        Panel("largest [m²]", [Curve("largest real part", time, real[:, -1])]),
        Panel("third smallest [m²]", [Curve("third smallest real part", time, real[:, 2])], log=True),
    ]
    return Drawn(
        picture("Real parts of the eigenvalues of $\\tilde J^T J$; W = 0.01 for joints 7 and 8", panels),
        {
            "smallest_m2": [float(real[:, 0].min()), float(real[:, 0].max())],
            "largest_m2": [float(real[:, -1].min()), float(real[:, -1].max())],
            "third_smallest_m2": [float(real[:, 2].min()), float(real[:, 2].max())],
        },
    )


def _figure(number: int, what: str, name: str, weights: dict[str, Any] | None = None) -> PaperFigure:
    """A figure of one of the runs.

    Args:
        number: Its number in the paper.
        what: What is drawn: tracking, tracking errors, joint coordinates or angles.
        name: The scenario.
        weights: ℱ or 𝒲, unless they are the identity.
    """
    given = weights or {}
    path = "joint 1" if name == Q1 else "joints 7 and 8"
    told = "".join(text for key, text in WEIGHTED.items() if key in given)
    title = f"{what}, nominal path by {path}{told}"

    def draw(runs: Runs) -> Drawn:
        points = at_points(runs, name, **given)
        if what == JOINTS:
            return _joints(runs, title, points, name, at_points(runs, name) if given else None)
        return {TRACKING: _tracking, ERRORS: _error_figure, ANGLES: _angles}[what](title, points)

    return PaperFigure(number, title, draw)


FIGURES = (
    _figure(3, TRACKING, Q1),
    _figure(4, ERRORS, Q1),
    _figure(5, JOINTS, Q1),
    _figure(6, ANGLES, Q1),
    _figure(7, ERRORS, Q1, LOOSE),
    _figure(8, JOINTS, Q1, LOOSE),
    _figure(9, ERRORS, Q1, BLOCKED),
    _figure(10, JOINTS, Q1, BLOCKED),
    PaperFigure(11, "Joint coordinates that generate the nominal path", _generator),
    _figure(12, TRACKING, Q7Q8),
    _figure(13, ERRORS, Q7Q8),
    _figure(14, JOINTS, Q7Q8),
    _figure(15, ANGLES, Q7Q8),
    _figure(16, TRACKING, Q7Q8, BLOCKED),
    _figure(17, JOINTS, Q7Q8, BLOCKED),
    _figure(18, ANGLES, Q7Q8, BLOCKED),
    PaperFigure(19, "Smallest and largest real part of the eigenvalues of J̃ᵀJ", _spectrum),
)


def _verdict(holds: bool, evidence: str, **numbers: Any) -> Finding:
    return Finding("reproduced" if holds else "contradicted", evidence, numbers)


def _variant(scenario: Scenario, **parameters: Any) -> Episode:
    """An episode of the method in a scenario that is not in the catalogue."""
    return rollout(scenario, make(METHOD, scenario, **parameters), 0)


def _steps_until(errors: FloatArray, level: float) -> float:
    """Inner steps until an error is below a level for the first time, NaN if it never is."""
    below = np.flatnonzero(errors < level)
    return float(below[0] + 1) if len(below) else float("nan")


def _level(runs: Runs) -> Finding:
    scenario = runs.scenario(Q1)
    nominal = scenario.nominal()
    vectors = turned(nominal)
    height, tilt = float(np.ptp(nominal[:, 11])), float(np.abs(vectors[:, :2]).max())
    realised = at_points(runs, Q1)
    varies = float(np.ptp(realised.settled(realised.pose[:, 11])))
    return _verdict(
        height < 1e-12 and tilt < 1e-12,
        f"X₃ᴺ varies by {height:.0e} m, and the axis of the nominal rotation leans off the vertical by at most "
        f"{tilt:.0e} rad; realised, X₃ varies by {1e3 * varies:.0f} mm after 1 s",
        height_m=height,
        tilt_rad=tilt,
    )


def _position_relaxes(runs: Runs) -> Finding:
    scenario, episode = runs.scenario(Q1), runs.play(Q1, METHOD)
    first = scenario.nominal()[0, 9:] - scenario.arm.forward(np.zeros(scenario.joints))[1]
    initial = float(np.linalg.norm(first))
    half, tenth = (_steps_until(episode.position_error, share * initial) for share in (0.5, 0.1))
    reached = 0.0 if np.isnan(tenth) else float(scenario.points()[int(tenth)] * scenario.dt)
    return _verdict(
        0.0 < reached < 0.1,
        f"{initial:.2f} m at the start, half of it after {half:.0f} inner steps, a tenth after {tenth:.0f}, that is at "
        f"s = {reached:.3f} s; root mean square after 1 s "
        f"{1e3 * _errors(at_points(runs, Q1))['rms_position_error_m']:.0f} mm",
        initial_m=initial,
        steps_to_half=half,
        steps_to_tenth=tenth,
    )


def _orientation_relaxes(runs: Runs) -> Finding:
    episode = runs.play(Q1, METHOD)
    angle = episode.orientation_error
    peak = int(angle.argmax())
    half, tenth = (_steps_until(angle[peak:], share * angle[peak]) for share in (0.5, 0.1))
    late = _errors(at_points(runs, Q1))["rms_orientation_error_rad"]
    tenth_text = "never" if np.isnan(tenth) else f"after {tenth:.0f} steps"
    return _verdict(
        _steps_until(angle[peak:], 0.1 * angle[peak]) < 1500,
        f"both arms are upright at home, so it starts at 0, grows to {angle[peak]:.2f} rad after {peak + 1} inner "
        f"steps while the position is pulled in, is half of that {half:.0f} steps later and a tenth {tenth_text}; "
        f"root mean square after 1 s {late:.2f} rad",
        peak_rad=float(angle[peak]),
        steps_to_peak=peak + 1,
        steps_from_peak_to_half=half,
        steps_from_peak_to_tenth=tenth,
    )


def _orientation_small(runs: Runs) -> Finding:
    numbers = {name: _errors(at_points(runs, name)) for name in (Q1, Q7Q8)}
    parts = [
        f"`{n}` up to {v['largest_orientation_error_rad']:.2f} rad and {1e3 * v['largest_position_error_m']:.0f} mm"
        for n, v in numbers.items()
    ]
    return Finding("not testable", f"no number is given; largest errors after 1 s: {'; '.join(parts)}", numbers)


def _more_at_first(runs: Runs) -> Finding:
    scenario = runs.scenario(Q1)
    usual = scenario.replace(iterations_per_point=(10,), steps=min(scenario.steps, 1000))
    few, many = _points(usual, _variant(usual)), at_points(runs, Q1)
    at = [min(k, len(many.time), len(few.time)) - 1 for k in (10, 100)]
    a, b = (points.position_error[at] for points in (few, many))
    return _verdict(
        bool((b < a).all()),
        f"position error at points 10 and 100: {b[0]:.2f} and {b[1]:.2f} m with 60 inner steps at the first ten "
        f"points, {a[0]:.2f} and {a[1]:.2f} m with 10",
        with_60_m=b.tolist(),
        with_10_m=a.tolist(),
    )


def _compare(runs: Runs, name: str, weights: dict[str, Any]) -> tuple[dict[str, float], dict[str, float]]:
    return _errors(at_points(runs, name)), _errors(at_points(runs, name, **weights))


def _in_words(before: dict[str, float], after: dict[str, float]) -> str:
    position, angle = "rms_position_error_m", "rms_orientation_error_rad"
    return (
        f"root mean square after 1 s: orientation {before[angle]:.3f} → {after[angle]:.3f} rad, position "
        f"{1e3 * before[position]:.1f} → {1e3 * after[position]:.1f} mm"
    )


def _weighted_down(runs: Runs) -> Finding:
    before, after = _compare(runs, Q1, LOOSE)
    return _verdict(
        after["rms_orientation_error_rad"] > before["rms_orientation_error_rad"],
        _in_words(before, after),
        before=before,
        after=after,
    )


def _coupling(runs: Runs) -> Finding:
    before, after = _compare(runs, Q1, LOOSE)
    change = after["rms_position_error_m"] / before["rms_position_error_m"] - 1.0
    return _verdict(
        abs(change) > 0.01,
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


def _moved(runs: Runs, name: str) -> Finding:
    """What joints 7 and 8 do, with 𝒲 and without."""
    free, held = (np.ptp(at_points(runs, name, **w).q[:, 6:], axis=0) for w in ({}, BLOCKED))
    return _verdict(
        bool((held < 0.1 * free).all()),
        f"q7 moves over {held[0]:.3f} instead of {free[0]:.2f} rad, q8 over {held[1]:.3f} instead of {free[1]:.2f} rad",
        with_w_rad=held.tolist(),
        without_w_rad=free.tolist(),
    )


def _growth(runs: Runs, name: str) -> float:
    """By how much 𝒲 multiplies the position error."""
    before, after = _compare(runs, name, BLOCKED)
    return after["rms_position_error_m"] / before["rms_position_error_m"]


def _still_good(runs: Runs) -> Finding:
    mine, other = _growth(runs, Q1), _growth(runs, Q7Q8)
    return _verdict(
        mine < other,
        f"{_in_words(*_compare(runs, Q1, BLOCKED))}: position {mine:.1f} times, against {other:.1f} times on `{Q7Q8}`",
        position_growth=mine,
        position_growth_q7q8=other,
    )


def _degraded(runs: Runs) -> Finding:
    before, after = _compare(runs, Q7Q8, BLOCKED)
    worse = all(after[key] > before[key] for key in ("rms_position_error_m", "rms_orientation_error_rad"))
    return _verdict(worse, _in_words(before, after), before=before, after=after)


def _acceptable(runs: Runs) -> Finding:
    errors = _errors(at_points(runs, Q7Q8))
    return Finding(
        "not testable",
        f"no number is given; root mean squares after 1 s {1e3 * errors['rms_position_error_m']:.0f} mm and "
        f"{errors['rms_orientation_error_rad']:.2f} rad, "
        f"{1e3 * errors['largest_position_error_m']:.0f} mm and {errors['largest_orientation_error_rad']:.2f} rad at "
        "most",
        {**errors},
    )


def _general(runs: Runs) -> Finding:
    nominal = runs.scenario(Q7Q8).nominal()
    extent, vectors = np.ptp(nominal[:, 9:], axis=0), turned(nominal)
    rank = np.linalg.svd(vectors, compute_uv=False)
    return _verdict(
        bool((extent > 0.0).all()) and rank[1] > 1e-6 * rank[0],
        f"X₁, X₂, X₃ range over {', '.join(f'{e:.2f}' for e in extent)} m; rotation from home up to "
        f"{np.linalg.norm(vectors, axis=1).max():.2f} rad, about changing axes",
        extent_m=extent.tolist(),
    )


def _smallest(runs: Runs) -> Finding:
    least = spectra(runs, Q7Q8, **BLOCKED)[:, 0]
    size = float(np.median(np.abs(least)))
    return _verdict(
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
    return _verdict(
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


def _stable(runs: Runs) -> Finding:
    """On the path the error must not grow; with the target held, it must fall for as long as one looks."""
    episode, points = runs.play(Q7Q8, METHOD, **BLOCKED), at_points(runs, Q7Q8, **BLOCKED)
    sound = bool((episode.status <= int(Status.ITERATION_LIMIT)).all())
    scenario = runs.scenario(Q7Q8)
    held = _variant(scenario.replace(iterations_per_point=(scenario.steps,)), **BLOCKED)
    at = [min(k, scenario.steps) - 1 for k in (1_000, 10_000, 100_000)]
    position, angle = held.position_error[at], held.orientation_error[at]
    falls = bool((np.diff(position) <= 0.0).all() and (np.diff(angle) <= 0.0).all())
    return _verdict(
        sound and falls and points.position_error[-1] <= points.position_error[0],
        f"{'no step' if sound else 'a step'} diverged or failed; with the first point held the errors after 1e3, 1e4 "
        f"and 1e5 inner steps are {', '.join(f'{1e3 * e:.0f}' for e in position)} mm and "
        f"{', '.join(f'{a:.3f}' for a in angle)} rad",
        held_position_error_m=position.tolist(),
        held_orientation_error_rad=angle.tolist(),
    )


def _counter_rotation(runs: Runs) -> Finding:
    numbers: dict[str, dict[str, Any]] = {}
    for name in (Q1, Q7Q8):
        episode = runs.play(name, METHOD, counter_rotation=False)
        sound = bool((episode.status <= int(Status.ITERATION_LIMIT)).all())
        numbers[name] = {
            "with": _errors(at_points(runs, name)),
            "without": _errors(at_points(runs, name, counter_rotation=False)),
            "sound": sound,
        }
    needed = any(
        not v["sound"] or v["without"]["rms_position_error_m"] > 1.1 * v["with"]["rms_position_error_m"]
        for v in numbers.values()
    )
    parts = [
        f"`{n}` {1e3 * v['with']['rms_position_error_m']:.1f} mm and {v['with']['rms_orientation_error_rad']:.3f} rad "
        f"with, {1e3 * v['without']['rms_position_error_m']:.1f} mm and "
        f"{v['without']['rms_orientation_error_rad']:.3f} rad without"
        for n, v in numbers.items()
    ]
    turns = at_points(runs, Q7Q8)
    median = float(np.nanmedian(turns.settled(turns.inside["angle_counter_rotation"])))
    return _verdict(
        needed,
        f"root mean square of the errors after 1 s: {'; '.join(parts)}; "
        f"{'no' if all(v['sound'] for v in numbers.values()) else 'a'} run without it failed; the angle of 𝒩 is "
        f"{median:.1g} rad in the median on `{Q7Q8}`",
        **numbers,
    )


def _compensates(runs: Runs, key: str, unit: str) -> Finding:
    """Against what the same arm does with the model's joint coordinates, uncorrected."""
    numbers = {
        name: {
            "method": _errors(at_points(runs, name))[key],
            "uncorrected": _errors(at_points(runs, name, "follow_nominal"))[key],
        }
        for name in (Q1, Q7Q8)
    }
    parts = [f"`{n}` {v['method']:.3f} {unit} against {v['uncorrected']:.3f} {unit}" for n, v in numbers.items()]
    return _verdict(
        all(v["method"] < v["uncorrected"] for v in numbers.values()),
        f"root mean square after 1 s, with the method and uncorrected: {'; '.join(parts)}",
        **numbers,
    )


def _precise_model(runs: Runs) -> Finding:
    numbers, sound = {}, True
    for name in (Q1, Q7Q8):
        scenario = runs.scenario(name)
        exact = scenario.replace(arm=scenario.model, model=scenario.model)
        episode = _variant(exact)
        sound = sound and bool((episode.status <= int(Status.ITERATION_LIMIT)).all())
        numbers[name] = {"precise": _errors(_points(exact, episode)), "approximate": _errors(at_points(runs, name))}
    keys = ("rms_position_error_m", "rms_orientation_error_rad")
    parts = []
    for name, v in numbers.items():
        mine, other = ([v[model][key] for key in keys] for model in ("precise", "approximate"))
        parts.append(
            f"`{name}` {1e3 * mine[0]:.0f} mm and {mine[1]:.3f} rad, with the approximate model {1e3 * other[0]:.0f} "
            f"mm and {other[1]:.3f} rad"
        )
    close = all(v["precise"][key] < 1.1 * v["approximate"][key] for v in numbers.values() for key in keys)
    return _verdict(
        sound and close,
        f"{'no step' if sound else 'a step'} failed; root mean square after 1 s: {'; '.join(parts)}",
        **numbers,
    )


def _inversion_free(runs: Runs) -> Finding:
    counts = runs.play(Q7Q8, METHOD).operations
    return _verdict(
        not counts.factorisations.any(),
        f"per inner step {counts.factorisations.mean():.0f} factorisations or inversions, "
        f"{counts.jacobians.mean():.0f} Jacobian of the model, {counts.measurements.mean():.0f} measured pose",
        factorisations=int(counts.factorisations.sum()),
    )


_RIVALS = ("moore_penrose", "broyden")


def _no_exploration(runs: Runs) -> Finding:
    """An advantage is one where the others need what this method does not."""
    episodes = {policy: runs.play(Q7Q8, policy) for policy in (METHOD, *_RIVALS)}
    measured = {policy: float(e.operations.measurements.mean()) for policy, e in episodes.items()}
    errors = {policy: _errors(at_points(runs, Q7Q8, policy))["rms_position_error_m"] for policy in episodes}
    parts = [f"`{p}` {measured[p]:.0f} a step, {1e3 * errors[p]:.1e} mm" for p in episodes]
    return _verdict(
        all(measured[p] > measured[METHOD] for p in _RIVALS),
        f"poses measured, and root mean square of the position error after 1 s: {'; '.join(parts)}",
        measurements=measured,
        rms_position_error_m=errors,
    )


def _less_hectic(runs: Runs) -> Finding:
    numbers = {}
    for policy in (METHOD, *_RIVALS):
        episode = runs.play(Q7Q8, policy)
        numbers[policy] = {
            "peak_rad_per_s": float(np.abs(episode.qdot).max()),
            "peak_after_point_10_rad_per_s": float(np.abs(episode.qdot[600:]).max(initial=0.0)),
            "travel_rad": float(np.abs(np.diff(episode.q, axis=0)).sum()),
        }
    parts = [
        f"`{p}` {v['peak_rad_per_s']:.1f} rad/s, {v['peak_after_point_10_rad_per_s']:.2f} rad/s after point 10, "
        f"{v['travel_rad']:.0f} rad of travel"
        for p, v in numbers.items()
    ]
    mine = numbers[METHOD]
    return _verdict(
        all(mine["peak_rad_per_s"] < numbers[p]["peak_rad_per_s"] for p in _RIVALS),
        f"peak velocities and sum of all joints' travel: {'; '.join(parts)}; the velocity limit is 50 rad/s",
        **numbers,
    )


def _two_joints(runs: Runs) -> Finding:
    """Planar arm with the links of Faitli's; the real parts of both eigenvalues must have one sign."""
    del runs
    upper, lower = 0.8, 0.5
    grid = np.linspace(-np.pi, np.pi, 121)
    a, b = np.meshgrid(grid, grid)
    along, across = lower * np.cos(a + b), -lower * np.sin(a + b)
    jacobian = np.stack([across - upper * np.sin(a), across, along + upper * np.cos(a), along], axis=-1)
    real = np.linalg.eigvals(jacobian.reshape(-1, 2, 2)).real
    positive, negative = float((real > 0.0).all(axis=1).mean()), float((real < 0.0).all(axis=1).mean())
    return _verdict(
        max(positive, negative) < 1.0,
        f"both positive in {positive:.0%} of all configurations, both negative in {negative:.0%}",
        both_positive=positive,
        both_negative=negative,
    )


def _sign_fails(runs: Runs) -> Finding:
    numbers = {}
    for name in TRAJECTORIES:
        tried = [runs.play(name, "fixed_point", transformation="sign", a=a) for a in (-1.0, -0.1, -0.02, 0.1, 1.0)]
        numbers[name] = {
            "best_m": min(float(e.position_error.max()) for e in tried),
            "transposed_m": float(runs.play(name, "fixed_point").position_error.max()),
            "successes": sum(bool((e.status != int(Status.DIVERGED)).all()) for e in tried),
        }
    parts = [f"`{n}` {v['best_m']:.2f} m at best, {1e3 * v['transposed_m']:.1f} mm with Jᵀ" for n, v in numbers.items()]
    return _verdict(
        all(v["successes"] == 0 for v in numbers.values()),
        f"in each run, with A of -1, -0.1, -0.02, 0.1, 1, steps diverged; largest error {'; '.join(parts)}"
        if not any(v["successes"] for v in numbers.values())
        else f"runs in which no step diverged: {', '.join(str(v['successes']) for v in numbers.values())}",
        **numbers,
    )


def _stagnates(runs: Runs) -> Finding:
    name = "faitli3-shoulder"
    scenario = runs.scenario(name)
    path = scenario.nominal_joint_path()
    nominal = np.zeros((scenario.steps, 3)) if path is None else path[1:]
    smallest = np.linalg.svd(scenario.arm.jacobian(nominal)[:, :3], compute_uv=False)[:, -1]
    near = smallest <= max(float(smallest.min()), 0.01)
    speeds = {
        policy: float(np.abs(runs.play(name, policy).qdot[near, 0]).mean())
        for policy in ("fixed_point", "moore_penrose")
    }
    speeds["nominal"] = float(np.abs(np.gradient(nominal[:, 0], scenario.dt)[near]).mean())
    stretched = {p: float(np.abs(runs.play(STRETCHED, p).qdot).max()) for p in ("fixed_point", "moore_penrose")}
    return _verdict(
        speeds["fixed_point"] < 0.1 * speeds["moore_penrose"],
        f"mean speed of q1 within 10 mm of the shoulder axis {speeds['fixed_point']:.3f} rad/s, "
        f"{speeds['moore_penrose']:.2f} rad/s of the pseudoinverse, {speeds['nominal']:.2f} rad/s nominal; at the "
        f"stretched elbow the peaks are {stretched['fixed_point']:.1f} and {stretched['moore_penrose']:.1f} rad/s",
        **speeds,
    )


def _damping_distorts(runs: Runs) -> Finding:
    name = TRAJECTORIES[1]
    errors = {
        policy: _rms(runs.play(name, policy).position_error) for policy in ("moore_penrose", "dls", "fixed_point")
    }
    return _verdict(
        errors["dls"] > errors["moore_penrose"],
        f"root mean square of the error on `{name}`: pseudoinverse {1e6 * errors['moore_penrose']:.1f} µm, damped "
        f"{1e6 * errors['dls']:.1f} µm, and the inversion-free fixed point {1e6 * errors['fixed_point']:.0f} µm",
        **errors,
    )


CLAIMS = (
    Claim(
        "level path",
        "With q1 alone X₃ᴺ is constant, and the last link turns about an axis parallel to X₃.",
        "section 4.2, fig. 3",
        f"nominal poses of `{Q1}`",
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
        "initial orientation error relaxes",
        "The inevitable initial tracking error rapidly decreases: orientation.",
        "section 4.2, fig. 4",
        "the same for the angle, from its peak: a tenth within the 1500 inner steps of the first hundredth",
        _orientation_relaxes,
    ),
    Claim(
        "small errors",
        "The orientation error is small, too; the results correspond to the expectations.",
        "section 4.2, fig. 3 and 4",
        "largest errors at grid points from s = 1 s on",
        _orientation_small,
    ),
    Claim(
        "60 inner steps at first",
        "60 instead of 10 inner steps at the first 10 points are better for the relaxation.",
        "section 3",
        f"`{Q1}` with 60 and with 10",
        _more_at_first,
    ),
    Claim(
        "F weights orientation down",
        "With F_ii = 0.5 for i = 1 … 9 the orientation precision is degraded.",
        "section 4.2, fig. 7",
        f"`{Q1}` with `task_weights`",
        _weighted_down,
    ),
    Claim(
        "F couples",
        "This shows some coupling with the tracking error of the end point.",
        "section 4.2, fig. 7",
        "change of the position error, more than 1 %",
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
        lambda runs: _moved(runs, Q1),
    ),
    Claim(
        "W keeps precision",
        "With W on the path by q1 the tracking precision remains good.",
        "section 4.2, fig. 9",
        f"growth of the position error, below that on `{Q7Q8}`, where the paper calls precision degraded",
        _still_good,
    ),
    Claim(
        "general path",
        "With q7 and q8 all of X₁, X₂, X₃ vary, and the orientation changes in a complicated way.",
        "section 4.3, fig. 11 and 12",
        f"nominal poses of `{Q7Q8}`",
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
        f"errors on `{Q7Q8}` with and without",
        _degraded,
    ),
    Claim(
        "W reduces q7 and q8",
        "With W on the path by q7 and q8 the motion of the last two joints is reduced.",
        "section 4.3, fig. 17",
        f"range of q7 and q8 on `{Q7Q8}`, with and without: below a tenth",
        lambda runs: _moved(runs, Q7Q8),
    ),
    Claim(
        "stable and convergent",
        "With W on the path by q7 and q8 the algorithm remains stable and convergent.",
        "section 4.3, fig. 18",
        "statuses and errors on the path, and errors with the first grid point held for the whole episode",
        _stable,
    ),
    Claim(
        "smallest eigenvalue",
        "The smallest real part of the eigenvalues of J̃ᵀJ scatters around 0 with an order of 1e-14.",
        "section 4.3, fig. 19",
        f"eigenvalues along the path of `{Q7Q8}` with W",
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
    Claim(
        "counter-rotation",
        "The counter-rotation serves to guarantee the convergence.",
        "abstract; section 2; section 5; fig. 6, 15, 18",
        "the same runs without it: does one diverge, or err by a tenth more?",
        _counter_rotation,
    ),
    Claim(
        "compensates position",
        "The effects of modelling errors can be compensated adaptively: position.",
        "section 5",
        "error beside that of the exact arm driven by the model's joint path, `follow_nominal`",
        lambda runs: _compensates(runs, "rms_position_error_m", "m"),
    ),
    Claim(
        "compensates orientation",
        "The effects of modelling errors can be compensated adaptively: orientation.",
        "section 5",
        "the same for the angle",
        lambda runs: _compensates(runs, "rms_orientation_error_rad", "rad"),
    ),
    Claim(
        "precise model",
        "The algorithm can be used for a precise enough model, too.",
        "section 5",
        "the same runs on the approximate arm, where the model is exact: failures, or errors larger by a tenth",
        _precise_model,
    ),
    Claim(
        "no inversion",
        "The algorithm is free of matrix inversions.",
        "title, abstract",
        "operation audit of the policy",
        _inversion_free,
    ),
    Claim(
        "no exploration",
        "In comparison with inversion the arm need not be investigated for each independent direction.",
        "section 5",
        "poses measured by closed loops with inversion under the same wrong model, `moore_penrose` and `broyden`, "
        "neither of which explores: an advantage if they need more",
        _no_exploration,
    ),
    Claim(
        "less hectic",
        "So less hectic motion of the arm is required.",
        "section 5",
        f"peak joint velocities on `{Q7Q8}` beside the same two",
        _less_hectic,
    ),
    Claim(
        "stagnation",
        "Near singularities inversion gives huge velocities; the iteration shows a pleasant stagnation instead.",
        "section 2",
        "q1 as `faitli3-shoulder` passes above the shoulder, `fixed_point` and `moore_penrose`: below a tenth",
        _stagnates,
    ),
    Claim(
        "two joints",
        "Without Jᵀ the condition of convergence fails for the simplest arm with 2 joints.",
        "section 2, after eq. 2.6",
        "signs of the real parts of the eigenvalues of J over all configurations of a planar arm, links 0.8 and 0.5 m",
        _two_joints,
    ),
    Claim(
        "sign variant",
        "σ = ±1 instead of the Jacobian had no success beyond 2 joints.",
        "section 2, eq. 2.8",
        "`fixed_point` with `transformation` `sign` on the three trajectories with 3 joints",
        _sign_fails,
    ),
    Claim(
        "damping distorts",
        "The damped inverse may degrade the precision in the nonsingular points.",
        "abstract; section 2",
        "`dls` and `moore_penrose` on a path without singular points",
        _damping_distorts,
    ),
)

PAPER = Paper(
    "khan",
    "Khan, Tar 2020: fixed-point iteration with abstract rotations",
    FIGURES,
    CLAIMS,
    readings=(
        "The generating functions of the nominal paths are not printed: q1 = 0.5 sin s, and q7 = 0.5 sin s with "
        "q8 = 0.5 sin 2s, s = 0 … 10 s.",
        "The 2× in Table 1 is included in the exact arm's axes.",
        "In the listing `B'*B` is a misprint for `A'*B`, without which nothing is orthogonal to B.",
        "`q_pp_max` and `epsa` are not printed; 1e3 and 1e-12 are taken.",
        "𝒩 is 8×8, without which eq. 3.16 does not fit together; the conclusion's 12 dimensions do not.",
        "The Jacobian is the derivative of the 12 numbers of f, not the stacked tangents of eq. 4.19, and 8 columns "
        "have it of rank 6 at most.",
        "f is measured on the exact arm, and only J̃ is of the model.",
        "Figures show the grid points, each after its last inner step; the steps between are played, not drawn.",
        "How the orientation error is measured is not said; it is the geodesic angle here.",
        "Figure 3, 12 and 16 have the angle of the rotation from home besides, since the text speaks of it.",
    ),
)
