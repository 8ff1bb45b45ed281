"""Khan and Tar 2020, abstract and section 5: what is concluded of the method, its model and the motion of the arm."""

from __future__ import annotations

import numpy as np

from baselines.papers.counts import count
from baselines.papers.khan.episodes import CHANGED, METHOD, Q1, Q7Q8, at_points, growth, points_of, settled_errors
from baselines.papers.paper import Claim, Finding, verdict, verdict_by_condition
from baselines.papers.runs import Runs
from baselines.status import Status

_COMPARED = ("moore_penrose", "broyden")


def _compensates(runs: Runs, key: str, unit: str) -> Finding:
    """Against what the same arm does with the model's joint coordinates, uncorrected."""
    numbers: dict[str, dict[str, float]] = {}
    for name in (Q1, Q7Q8):
        scenario = runs.scenario(name)
        longer = scenario.replace(
            iterations_per_point=(60,) * 10 + (50,),
            steps=600 + 5 * max(scenario.steps - 600, 0),
        )
        numbers[name] = {
            "uncorrected": settled_errors(at_points(runs, name, "follow_nominal"))[key],
            "as printed": settled_errors(at_points(runs, name))[key],
            "with 50 inner steps": settled_errors(at_points(runs, longer))[key],
            "with λ_a = 3e-3": settled_errors(at_points(runs, name, lambda_a=3e-3))[key],
        }
    parts = [f"`{n}` {', '.join(f'{e:.3f} {unit} {what}' for what, e in v.items())}" for n, v in numbers.items()]
    return verdict_by_condition(
        {
            f"{n} {what}": e < v["uncorrected"]
            for n, v in numbers.items()
            for what, e in v.items()
            if what != "uncorrected"
        },
        f"root mean square after 1 s: {'; '.join(parts)}",
        **numbers,
    )


def _precise_model(runs: Runs) -> Finding:
    numbers, sound = {}, True
    for name in (Q1, Q7Q8):
        scenario = runs.scenario(name)
        exact = scenario.replace(arm=scenario.model, model=scenario.model)
        episode = runs.play(exact, METHOD)
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
    close = all(max(growth(v["approximate"], v["precise"])) <= CHANGED for v in numbers.values())
    return verdict(
        sound and close,
        f"{'no step' if sound else 'a step'} failed; root mean square after 1 s: {'; '.join(parts)}",
        **numbers,
    )


def _inversion_free(runs: Runs) -> Finding:
    del runs
    steps = count(Q7Q8, METHOD)
    factorisations = sum(step.factorisations for step in steps)
    return verdict(
        factorisations == 0,
        f"counted call by call in {len(steps)} steps: {factorisations / len(steps):.0f} factorisations or inversions, "
        f"{np.mean([step.jacobians for step in steps]):.0f} Jacobian of the model and "
        f"{np.mean([step.measurements for step in steps]):.0f} measured pose a step",
        factorisations=factorisations,
    )


def _no_exploration(runs: Runs) -> Finding:
    """An advantage is one where the others need what this method does not."""
    episodes = {policy: runs.play(Q7Q8, policy) for policy in (METHOD, *_COMPARED)}
    measured = {policy: float(np.mean([step.measurements for step in count(Q7Q8, policy)])) for policy in episodes}
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
        "compensates position",
        "The effects of modelling errors can be compensated adaptively: position.",
        "section 5",
        "error beside that of the exact arm driven by the model's joint path, `follow_nominal`, under three "
        "conditions: 10 inner steps a point and λ_a = 5e-4 as printed; 50 inner steps; λ_a = 3e-3",
        lambda runs: _compensates(runs, "rms_position_error_m", "m"),
    ),
    Claim(
        "compensates orientation",
        "The effects of modelling errors can be compensated adaptively: orientation.",
        "section 5",
        "the same for the angle, under the same conditions",
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
        "operations of an inner step, counted call by call in a few steps",
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
        f"peak joint velocities on `{Q7Q8}` beside the same two, below both",
        _less_hectic,
    ),
)
