"""The page "Which solver for my arm?": a decision table, and the tables behind it, worked out from a measurement."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from baselines import registry
from baselines.evaluation.pages import sets
from baselines.evaluation.pages.choosing.situations import (
    COST,
    EQUAL,
    ERROR,
    SITUATIONS,
    SMALL,
    Situation,
    Standing,
    chosen,
    ranked,
    standings,
)
from baselines.evaluation.pages.entries import FORESIGHT, Entry, first_seed, solver
from baselines.evaluation.pages.markdown import conditions, table, time
from baselines.evaluation.pages.measurement import Measurement, Section
from baselines.evaluation.report import NOTHING, number
from baselines.spec import parse_policy

#: Who is compared, besides all solvers of other projects.
OWN = (
    *("dls", "null_space", "weighted_pseudoinverse", "qp", "qp:task_scaling=True", "sns", "broyden", "mfac"),
    *("rhc:horizon=100,iterations=1,move_blocks=23", "rhc", FORESIGHT),
)
#: Who takes milliseconds a step where a path cannot be followed, and plays nothing but the paths of real arms.
SLOW = ("rhc",)
#: Who is shown beside the one that is named: what is plain and widely used.
PLAIN = "dls"
#: The share of each test set's episodes, the first ones, that is played.
SHARE = 1 / 4
#: Control periods, in [µs], that a call may take.
PERIODS = (25, 50, 100, 250, 500, 1000)

INTRODUCTION = f"""\
Look for the lines that describe your task; where several do, read the tables of all of them below. Every figure was
measured on the [paths of real arms](scenarios.md#paths-of-real-arms) or on random motions, written by
`python -m baselines.leaderboard --pages choosing` from [choosing.json](choosing.json); see [conditions](#conditions).
Compared are solvers of this package as they are, and those of [other projects](policies.md) (Pink, mink,
roboticstoolbox, ssik) where they take such a scenario.

- **Error** is the largest of all episodes, in mm of position or mrad of orientation, whichever is larger: costs weigh
  them alike. **× least** is that divided by the lowest error of all solvers in the same scenario, both at least
  {SMALL:g}; where several scenarios are put together, the largest.
- **Cost** is the total cost divided by the lowest of all solvers in the same episode, in the geometric mean.
- **Held back** is the share of the steps in which a joint was held back by its stop, by its velocity and by its
  acceleration limit, in this order.
- **p50, p99** are of single calls, in µs: the largest of the scenarios.
- **Named** is the solver with the lowest *× least* of those that never ran into a stop, or of all if each of them did;
  of those within {100.0 * (EQUAL - 1.0):.0f} % of it the one with the lowest p50. Where costs are compared, the cost
  takes the place of *× least*.
- **Beside it** is who would be named of the other projects, or of this package where one of them is named.
"""


def entries(name: str | None = None) -> tuple[Entry, ...]:
    """All that are compared, each with one seed of the policy, in a part of the random episodes.

    Args:
        name: Of a set of episodes, for those that play it.
    """
    rivals = tuple(name for name in registry.names() if registry.get(name).rival)
    left_out = SLOW if name is not None and name not in sets.rivals() else ()
    entered = (solver(spec, timed=1) for spec in (*OWN, *rivals) if spec not in left_out)
    return tuple(first_seed(one, SHARE) for one in entered)


def played() -> tuple[str, ...]:
    """All sets of episodes that a situation is made of, each once."""
    return tuple(dict.fromkeys(name for one in SITUATIONS for name in one.sets))


def page(measurement: Measurement) -> str:
    """The page as Markdown."""
    sections = measurement.sections
    found = {one: standings(one, sections) for one in SITUATIONS if one.among(sections)}
    out = ["# Which solver for my arm?", "", INTRODUCTION, *_trial(sections)]
    out += ["## By what the task demands", "", *_decisions(found), "", *_sentences(found), ""]
    out += ["## By the control period", "", *_by_period(sections), ""]
    for one, stand in found.items():
        out += _details(one, stand, one.among(sections))
    return "\n".join([*out, *conditions(measurement)]) + "\n"


def _trial(sections: Sequence[Section]) -> list[str]:
    """What has to be said where not everything was played."""
    there, wanted = {one.name for one in sections}, played()
    if there >= set(wanted):
        return []
    return [f"**A trial**: {len(there)} of {len(wanted)} scenarios were played.", ""]


def rival(label: str) -> bool:
    """Whether a solver is one of another project."""
    return bool(registry.get(parse_policy(label)[0]).rival)


def _decisions(found: dict[Situation, list[Standing]]) -> list[str]:
    head = ["what is known of the task", "take", "error [mm, mrad]", "× least", "cost", *_heads()]
    head += [f"error of `{PLAIN}`", "beside it: error, × least, p50"]
    return table(head, (_decision(one, stand) for one, stand in found.items()), text=(0, 1))


def _decision(one: Situation, stand: Sequence[Standing]) -> list[str]:
    best = chosen(stand, one.by)
    plain = next((number(s.error) for s in stand if s.label == PLAIN), NOTHING)
    others = [s for s in stand if rival(s.label) != rival(best.label)]
    other = chosen(others, one.by) if others else None
    words = NOTHING
    if other is not None:
        words = f"`{other.label}`: {number(other.error)}, {number(other.above)}, {time(other.p50)}"
    return [f"[{one.name}](#{_anchor(one.name)})", f"`{best.label}`", *_cells(best), plain, words]


def _heads() -> list[str]:
    return ["held back [%]", "p50 [µs]", "p99 [µs]"]


def _cells(one: Standing) -> list[str]:
    """The cells of a solver."""
    held = ", ".join(f"{100.0 * share:.3g}" for share in one.held_back)
    return [*map(number, (one.error, one.above, one.cost)), held, *map(time, (one.p50, one.p99))]


def _sentences(found: dict[Situation, list[Standing]]) -> list[str]:
    """How often each solver is named, and where nobody came through without a stop."""
    named: dict[str, int] = {}
    for one, stand in found.items():
        label = chosen(stand, one.by).label
        named[label] = named.get(label, 0) + 1
    counts = ", ".join(f"`{label}` {count}" for label, count in sorted(named.items(), key=lambda item: -item[1]))
    out = [f"- Times named: {counts}."]
    blocked = [one.name for one, stand in found.items() if all(s.held_back[0] for s in stand)]
    if blocked:
        out.append(f"- Every solver ran into a stop where {' and where '.join(blocked)}.")
    return out


def _by_period(sections: Sequence[Section]) -> list[str]:
    """Who is named for a control period: over all paths of real arms together, among those whose p99 fits into it."""
    paths = [one for one in sections if one.name in sets.rivals()]
    stand = ranked(paths, COST)
    lines = []
    for period in PERIODS:
        best = next((one for one in stand if one.p99 <= period), None)
        cells = [NOTHING] * 7 if best is None else [f"`{best.label}`", *_cells(best)]
        lines.append([f"{period:,}", *cells])
    text = (
        f"Over all {len(paths)} paths of real arms together, of the solvers whose p99 fits into the period on each of "
        "them the one with the lowest cost:"
    )
    head = ["control period [µs]", "take", "error [mm, mrad]", "× least", "cost", *_heads()]
    return [text, "", *table(head, lines, text=(1,))]


def _details(one: Situation, stand: Sequence[Standing], sections: Sequence[Section]) -> list[str]:
    """All solvers in a situation."""
    scenarios = ", ".join(f"`{s.name}`" for s in sections)
    lines = [[f"`{s.label}`", *_cells(s)] for s in stand]
    head = ["solver", "error [mm, mrad]", "× least", "cost", *_heads()]
    by = "lowest × least" if one.by == ERROR else "lowest cost"
    out = [f"## {one.name[0].upper()}{one.name[1:]}", "", f"{one.meaning} Played: {scenarios}. The {by} first."]
    return [*out, "", *table(head, lines, text=(0,)), "", *_absent(sections, stand), ""]


def _absent(sections: Iterable[Section], stand: Sequence[Standing]) -> list[str]:
    """Who has not played all scenarios of a situation."""
    shown = {one.label for one in stand}
    everyone = dict.fromkeys(line.label for one in sections for line in one.lines)
    wanted = dict.fromkeys((*everyone, *(entry.label for entry in entries())))
    absent = [f"`{label}`" for label in wanted if label not in shown]
    if not absent:
        return []
    return [f"Not played there, since they are not made for it, not installed, or too slow: {', '.join(absent)}."]


def _anchor(title: str) -> str:
    """What a heading is linked by."""
    return "".join(c for c in title.lower().replace(" ", "-") if c.isalnum() or c in "-_")
