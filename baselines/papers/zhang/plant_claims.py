"""Zhang 2020 on plants: what λ does in a loop with a delay or noise, and how far model-free control needs a model."""

from __future__ import annotations

import itertools

import numpy as np

from baselines.papers.paper import Claim, Finding, rms, verdict_by_condition
from baselines.papers.runs import Runs
from baselines.papers.zhang.comparing import CHANGE, change, falls
from baselines.papers.zhang.episodes import HELIX, LINE, settled_from
from baselines.solvers.levenberg_marquardt.damping_parameters import typical_link
from ikgym import Plant
from ikgym.scenarios import Scenario

SHARES = (0.0, 1e-3, 1e-1, 10.0)  # λ in l²: 0, the range of remark 2, and what is sufficiently large in any reading
PLANTS = {
    "commands 1 sample late": Plant(command_delay=1),
    "commands 3 samples late": Plant(command_delay=3),
    "pose with noise of 1 mm": Plant(pose_noise=1e-3, pose_rotation_noise=1e-3),
}
#: Errors of a good calibration, and of none: joint zeros in [rad], links in [m], axes in [rad].
CALIBRATIONS = {"0.5 mrad and 0.3 mm": (5e-4, 3e-4), "10 mrad and 10 mm": (1e-2, 1e-2)}
ARMS = 3
CONTROLLERS = {
    "(5) with the measured pose": ("mfac", {"one_step": True, "rule": "constant", "damping": 0.0}),
    "iterated on the model, (11) to (17)": ("mfac", {}),
}


def _on(scenario: Scenario, plant: Plant) -> Scenario:
    return scenario.replace(name=f"{scenario.name} on a plant", plant=plant)


def _robustness(runs: Runs) -> Finding:
    """The largest error as stability, where the loop has a delay; the peak joint velocity, where it has noise."""
    scenario = runs.scenario(LINE)
    pairs, parts = {}, []
    for name, plant in PLANTS.items():
        values = []
        for share in SHARES:
            damping = share * typical_link(scenario.arm) ** 2
            episode = runs.play(_on(scenario, plant), "mfac", one_step=True, rule="constant", damping=damping)
            late = plant.command_delay != 0
            values.append(float(episode.position_error.max() if late else np.abs(episode.qdot).max()))
        for (low, before), (high, after) in itertools.pairwise(zip(SHARES, values, strict=True)):
            pairs[f"{name}, λ = {low:g} to {high:g} l²"] = before, after
        what, unit = ("largest errors", "m") if plant.command_delay else ("peak joint velocities", "rad/s")
        parts.append(f"{name}: {what} {', '.join(f'{v:.3g}' for v in values)} {unit}")
    return falls(pairs, f"λ = {', '.join(f'{share:g}' for share in SHARES)} l²; {'; '.join(parts)}")


def _model_free(runs: Runs) -> Finding:
    """A controller that needs no model tracks a wrong arm as it does the right one."""
    holds, parts, numbers = {}, [], {}
    for place, (which, (zero, link)) in itertools.product((HELIX, LINE), CALIBRATIONS.items()):
        scenario = runs.scenario(place)
        source = scenario.replace(plant=Plant(zero=zero, link=link, axis=zero))
        arms = [source.drawn_plant(seed).arm for seed in range(ARMS)]
        for controller, (policy, options) in CONTROLLERS.items():
            exact, *wrong = (
                rms(episode.position_error[settled_from(episode) :])
                for episode in (
                    runs.play(scenario.replace(arm=arm, model=scenario.model), policy, **options)
                    for arm in (scenario.arm, *arms)
                )
            )
            numbers[f"{controller}, {place}, {which}"] = [exact, *wrong]
            holds[f"{controller}, {place}, {which}"] = change(exact, max(wrong)) < CHANGE
            parts.append(
                f"`{place}`, {which}, {controller}: {exact:.2g} m exact, {min(wrong):.2g} to {max(wrong):.2g} m"
            )
    return verdict_by_condition(holds, "; ".join(parts), rms_position_error_m=numbers)


CLAIMS = (
    Claim(
        "robustness on plants",
        "Robustness improves as λ increases: in a loop with a delay, or with noise in the pose.",
        "section III B",
        "`mfac` with `one_step` on `zhang6-lspb`, with λ of 0, 0.001, 0.1 and 10 l², commands 1 or 3 samples late "
        "(largest position error, as stability), or poses with noise of 1 mm and 1 mrad (peak joint velocity); each "
        "step of λ should lower the figure, changes of less than 10 % not counting",
        _robustness,
    ),
    Claim(
        "model-free",
        "The adaptive control is model-free.",
        "title; section III A",
        "root mean square of the position error behind the transient on both examples, with 3 arms each whose joint "
        "zeros, links and axes differ from the controller's model by 0.5 mrad and 0.3 mm, or 10 mrad and 10 mm: on the "
        "worst of them less than 10 % larger than with the exact model; in two readings of the controller, (5) with "
        "the measured pose and the iteration within a sample, which works on the pose that its model has",
        _model_free,
    ),
)
