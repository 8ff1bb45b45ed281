"""Khan and Tar 2020: the counter-rotation in its two readings, the method it is taken from (eq. 2.9), and J_Prev_a."""

from __future__ import annotations

from typing import Any

from baselines.papers.khan.episodes import CHANGED, METHOD, Q1, Q7Q8, at_points, growth, settled_errors
from baselines.papers.paper import Claim, Finding, verdict, verdict_by_condition
from baselines.papers.runs import Runs
from baselines.status import Status

PRINTED: dict[str, Any] = {}
CONTRACTION: dict[str, Any] = {"deformation": "contraction"}
NONE: dict[str, Any] = {"counter_rotation": "none"}
TASK: dict[str, Any] = {"counter_rotation": "task"}
HELD: dict[str, Any] = {"jacobian": "point"}


def _no_worse(runs: Runs, name: str, one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Whether no step of a variant has failed, and neither error is larger by more than a tenth than another's."""
    sound = bool((runs.play(name, METHOD, **one).status <= int(Status.ITERATION_LIMIT)).all())
    errors = (settled_errors(at_points(runs, name, **given)) for given in (other, one))
    return sound and max(growth(*errors)) <= CHANGED


def _errors(runs: Runs, variants: dict[str, dict[str, Any]]) -> tuple[str, dict[str, Any]]:
    """What several variants come to on both paths, in words and numbers."""
    numbers = {
        name: {what: settled_errors(at_points(runs, name, **given)) for what, given in variants.items()}
        for name in (Q1, Q7Q8)
    }
    parts = [
        f"`{name}` "
        + ", ".join(
            f"{1e3 * v['rms_position_error_m']:.1f} mm and {v['rms_orientation_error_rad']:.3f} rad {what}"
            for what, v in of_path.items()
        )
        for name, of_path in numbers.items()
    ]
    return f"root mean square of the errors after 1 s: {'; '.join(parts)}", numbers


def _counter_rotation(runs: Runs) -> Finding:
    """Of use is what cannot be left out, in either reading and either method."""
    words, numbers = _errors(
        runs,
        {
            "with 𝒩 of 8×8": PRINTED,
            "of 12×12": TASK,
            "without": NONE,
            "in eq. 2.9 with": CONTRACTION,
            "in eq. 2.9 without": {**CONTRACTION, **NONE},
        },
    )
    pairs = {
        "8×8": (NONE, PRINTED),
        "12×12": (NONE, TASK),
        "eq. 2.9": ({**CONTRACTION, **NONE}, CONTRACTION),
    }
    needed = {what: any(not _no_worse(runs, name, *pair) for name in (Q1, Q7Q8)) for what, pair in pairs.items()}
    return verdict_by_condition(needed, words, **numbers)


def _dineva(runs: Runs) -> Finding:
    words, numbers = _errors(runs, {"with eq. 2.9": CONTRACTION, "with eq. 3.16": PRINTED})
    return verdict(all(_no_worse(runs, name, CONTRACTION, PRINTED) for name in (Q1, Q7Q8)), words, **numbers)


def _twelve(runs: Runs) -> Finding:
    words, numbers = _errors(runs, {"with 12×12": TASK, "with 8×8": PRINTED})
    alike = all(_no_worse(runs, name, *pair) for name in (Q1, Q7Q8) for pair in ((TASK, PRINTED), (PRINTED, TASK)))
    return Finding(
        "not testable",
        f"their errors {'do not ' if alike else ''}differ by more than a tenth: {words}"
        + ("; they cannot tell which was meant" if alike else ""),
        numbers,
    )


def _held_jacobian(runs: Runs) -> Finding:
    words, numbers = _errors(runs, {"with J̃ of the point": HELD, "with J̃ of each inner step": PRINTED})
    return verdict(all(_no_worse(runs, name, HELD, PRINTED) for name in (Q1, Q7Q8)), words, **numbers)


CLAIMS = (
    Claim(
        "counter-rotation",
        "The counter-rotation serves to guarantee the convergence.",
        "abstract; section 2; section 5; fig. 6, 15, 18",
        "runs without it, with abstract rotations and with eq. 2.9: a step fails or a root mean square is larger by "
        "more than a tenth than with 𝒩, in joint space or in the conclusion's 12 dimensions",
        _counter_rotation,
    ),
    Claim(
        "12 dimensions",
        "The counter-rotations were realized in a 12 dimensional space.",
        "section 5",
        "`counter_rotation` `task` and `joints`: does either fail, or err by more than a tenth more?",
        _twelve,
    ),
    Claim(
        "Dineva's iteration",
        "The counter-rotation had good convergence with Dineva's iteration, too.",
        "section 2, eq. 2.9, after [19]",
        "`deformation` `contraction` with the measured pose, λ_a = 5e-4 = -A F'(ξ*): no step fails, and no root mean "
        "square is larger by more than a tenth than with abstract rotations",
        _dineva,
    ),
    Claim(
        "J_Prev_a",
        "The internal cycle of a grid point is called with J_Prev_a, a Jacobian from before.",
        "section 4.1, the call in the text",
        "`jacobian` `point`, held during the point, and `step`: no step fails, and no root mean square is larger by "
        "more than a tenth",
        _held_jacobian,
    ),
)
