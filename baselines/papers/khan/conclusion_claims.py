"""Khan and Tar 2020, abstract and section 5: what is concluded of the method, its model and the motion of the arm."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.evaluation.operation_audit import audit
from baselines.papers.khan.episodes import METHOD, Q1, Q7Q8, at_points, points_of, settled_errors, variant
from baselines.papers.paper import Claim, Finding, verdict
from baselines.papers.runs import Runs
from baselines.status import Status

_COMPARED = ("moore_penrose", "broyden")


def _counter_rotation(runs: Runs) -> Finding:
    numbers: dict[str, dict[str, Any]] = {}
    for name in (Q1, Q7Q8):
        episode = runs.play(name, METHOD, counter_rotation=False)
        sound = bool((episode.status <= int(Status.ITERATION_LIMIT)).all())
        numbers[name] = {
            "with": settled_errors(at_points(runs, name)),
            "without": settled_errors(at_points(runs, name, counter_rotation=False)),
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
    median = float(np.nanmedian(turns.settled(turns.diagnostics["angle_counter_rotation"])))
    return verdict(
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
            "method": settled_errors(at_points(runs, name))[key],
            "uncorrected": settled_errors(at_points(runs, name, "follow_nominal"))[key],
        }
        for name in (Q1, Q7Q8)
    }
    parts = [f"`{n}` {v['method']:.3f} {unit} against {v['uncorrected']:.3f} {unit}" for n, v in numbers.items()]
    return verdict(
        all(v["method"] < v["uncorrected"] for v in numbers.values()),
        f"root mean square after 1 s, with the method and uncorrected: {'; '.join(parts)}",
        **numbers,
    )


def _precise_model(runs: Runs) -> Finding:
    numbers, sound = {}, True
    for name in (Q1, Q7Q8):
        scenario = runs.scenario(name)
        exact = scenario.replace(arm=scenario.model, model=scenario.model)
        episode = variant(exact)
        sound = sound and bool((episode.status <= int(Status.ITERATION_LIMIT)).all())
        numbers[name] = {
            "precise": settled_errors(points_of(exact, episode)),
            "approximate": settled_errors(at_points(runs, name)),
        }
    keys = ("rms_position_error_m", "rms_orientation_error_rad")
    parts = []
    for name, v in numbers.items():
        mine, other = ([v[model][key] for key in keys] for model in ("precise", "approximate"))
        parts.append(
            f"`{name}` {1e3 * mine[0]:.0f} mm and {mine[1]:.3f} rad, with the approximate model {1e3 * other[0]:.0f} "
            f"mm and {other[1]:.3f} rad"
        )
    close = all(v["precise"][key] < 1.1 * v["approximate"][key] for v in numbers.values() for key in keys)
    return verdict(
        sound and close,
        f"{'no step' if sound else 'a step'} failed; root mean square after 1 s: {'; '.join(parts)}",
        **numbers,
    )


def _inversion_free(runs: Runs) -> Finding:
    counts, (audited,) = runs.play(Q7Q8, METHOD).operations, audit(Q7Q8, [(METHOD, {})])
    counted = audited.total("factorisations")
    return verdict(
        not counts.factorisations.any() and counted == 0 and audited.agrees,
        f"per inner step {counts.factorisations.mean():.0f} factorisations or inversions, "
        f"{counts.jacobians.mean():.0f} Jacobian of the model, {counts.measurements.mean():.0f} measured pose; counted "
        f"call by call in {len(audited.counted)} steps: {counted} factorisations",
        factorisations=int(counts.factorisations.sum()),
        factorisations_counted=counted,
    )


def _no_exploration(runs: Runs) -> Finding:
    """An advantage is one where the others need what this method does not."""
    episodes = {policy: runs.play(Q7Q8, policy) for policy in (METHOD, *_COMPARED)}
    measured = {policy: float(e.operations.measurements.mean()) for policy, e in episodes.items()}
    errors = {policy: settled_errors(at_points(runs, Q7Q8, policy))["rms_position_error_m"] for policy in episodes}
    parts = [f"`{p}` {measured[p]:.0f} a step, {1e3 * errors[p]:.1e} mm" for p in episodes]
    return verdict(
        all(measured[p] > measured[METHOD] for p in _COMPARED),
        f"poses measured, and root mean square of the position error after 1 s: {'; '.join(parts)}",
        measurements=measured,
        rms_position_error_m=errors,
    )


def _less_hectic(runs: Runs) -> Finding:
    numbers = {}
    for policy in (METHOD, *_COMPARED):
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
    return verdict(
        all(mine["peak_rad_per_s"] < numbers[p]["peak_rad_per_s"] for p in _COMPARED),
        f"peak velocities and sum of all joints' travel: {'; '.join(parts)}; the velocity limit is 50 rad/s",
        **numbers,
    )


CLAIMS = (
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
)
