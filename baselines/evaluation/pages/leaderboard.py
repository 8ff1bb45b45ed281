"""The leaderboard: what the numbers say, tables and plots, all of it worked out from what was measured."""

from __future__ import annotations

import pathlib
import statistics
from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure

from baselines.evaluation.pages import leaderboard_plots as plots
from baselines.evaluation.pages import sets
from baselines.evaluation.pages.claims import few, quoted, sentences
from baselines.evaluation.pages.entries import ENOUGH, FORESIGHT, PAPER, label, short
from baselines.evaluation.pages.markdown import (
    IMAGES,
    between,
    collapsed,
    conditions,
    episodes,
    fewer_episodes,
    lost,
    runs,
    share,
    table,
    time,
)
from baselines.evaluation.pages.measurement import (
    AGENT,
    FAR,
    NEAR,
    REFERENCE,
    RESIDUAL,
    Line,
    Measurement,
    Section,
)
from baselines.evaluation.pages.statistics import geometric_interval, interval
from baselines.evaluation.pages.tuning import Tuning, update
from baselines.evaluation.report import NOTHING, number
from baselines.evaluation.summary import Spread
from ikgym.validation import FloatArray

#: The plots, seen from the page, as the page is called.
MEANS, PROFILES = "{}-means.png", "{}-profiles.png"
#: Lines of the profiles besides agents: the best that look further, and the best that do not.
SHOWN = {FAR: 2, NEAR: 5}
ORACLE = "oracle"
#: Errors that runs are counted by, in [m].
WITHIN = (0.010, 0.001)
DETERMINISTIC = "deterministic"

INTRODUCTION = """\
Trained agents beside all solvers, on the [test set](evaluation.md#test-sets) `{name}`: {count} test episodes that
nobody was trained or tuned on. Written by `python -m baselines.leaderboard`, see [conditions](#conditions); everything
below is worked out from what was measured, which lies in [{file}]({file}).
"""
#: What has to be said of the pages before that.
ABOUT = {
    sets.MAIN: """\
The arm tracks the whole pose. [leaderboard_skew.md](leaderboard_skew.md) has the same motions in the papers' own skew
coordinates, in which a wrong orientation can be cheaper than the right one. The agents were trained on whole poses.
Of those that come with the package, `agent_…`, one training seed was kept; others stand with all of theirs, trained as
[agents.md](agents.md) says.
""",
    sets.SKEW: """\
**The papers' own coordinates, as they were measured for the test sets of version 0.2.0**, and not since: an arm counted
as lost by its position alone, and agents that were shown skew coordinates stand here. The
[leaderboard](leaderboard.md) is that of whole poses: the cost of skew coordinates is the same for some wrong
orientations, and [rewards them now and then](evaluation.md#what-skew-coordinates-reward).
""",
}

LEGEND = f"""\
- **Cost ratio** is the total cost divided by the [best known cost](evaluation.md#best-known-costs) of the episode. A
  geometric mean hinges on a few episodes: look at median, 90th percentile and worst, too.
- **95 %** is the interval of the geometric mean by a **two-level bootstrap**, 9,999 resamples: seeds are drawn with
  replacement outside, and inside episodes, once for all of the seeds drawn. Seeds and episodes are crossed, since every
  seed plays the very same episodes: drawn for each seed anew, as if each had episodes of its own, their luck would seem
  to average out over the seeds, and the interval would be too narrow. Where there is one seed or none, episodes alone
  are drawn. Five seeds are few: where they differ much more than episodes do, the interval is somewhat too narrow.
- **Seeds**: solvers are `{DETERMINISTIC}`, their interval is over episodes alone. Of `{FORESIGHT}`, which draws at
  random, they are seeds of the policy; of agents seeds of training, and with fewer than {ENOUGH} an agent is no
  benchmark. All numbers of a line are over the runs of all of its seeds.
- **Foresight** is how many steps ahead a policy looks.
- **≤ 10 mm, ≤ 1 mm** are the shares of runs in which the arm was at no time farther from where it should have been.
- **p50, p99** are of single calls of `predict` after the first, in [µs], in episodes that were played alone: the median
  of the medians, and the largest 99th percentile.
- **Steps** (of the environment, or samples) and **core-min** (minutes × cores) are what a training seed has cost, in
  the mean.
- Kinds: a **{NEAR}** looks no further than the paper's horizon, {PAPER} steps ahead, a **{FAR}** does; an **{AGENT}**
  stands alone, a **{RESIDUAL}** adds to the action of a base policy; a **{REFERENCE}** has privileged information.
  *Tuned* solvers have [settings that were searched](#tuned-solvers) on validation episodes.
- **Bold** is the lowest geometric mean of each kind.
"""

PROFILE = """\
A curve shows which share of runs has a cost ratio of at most τ: the higher, and the further to the left, the better.
Where it ends below 100 %, the rest has a cost ratio of more than a thousand. Solid lines are all agents, dashed
ones the best solvers.
"""


def pictures(measurement: Measurement, called: str = "leaderboard") -> Iterator[tuple[pathlib.PurePath, Figure]]:
    """The plots, and where they lie, seen from the page of that name."""
    section = measurement.sections[0]
    cost_ratios, spreads = section.cost_ratios(), section.spreads()
    marks = [plots.Mean(f"{ORACLE} (best known)", REFERENCE, 1.0, 1.0, 1.0)]
    for line in section.ranked():
        low, high = geometric_interval(cost_ratios[line.label])
        marks.append(plots.Mean(_plain(line), line.kind, spreads[line.label].mean, low, high))
    title = f"{section.name}, {len(section.seeds)} test episodes"
    yield IMAGES / MEANS.format(called), plots.means(title, marks)
    shown = profiled(section)
    curves = {_plain(line): cost_ratios[line.label] for line in shown}
    yield IMAGES / PROFILES.format(called), plots.profiles(title, curves, {_plain(line): line.kind for line in shown})


def profiled(section: Section) -> list[Line]:
    """The lines whose profile is drawn: all agents, and the best solvers, from the best on."""
    ranked, left = section.ranked(), dict(SHOWN)
    out = []
    for line in ranked:
        if not line.learned:
            left[line.kind] -= 1
        if line.learned or left[line.kind] >= 0:
            out.append(line)
    return out


def page(measurement: Measurement, tuning: Tuning, called: str = "leaderboard") -> str:
    """The page as Markdown.

    Args:
        measurement: What was measured; its first section is the main test set.
        tuning: How the tuned solvers came to their settings.
        called: The name of the page, which its pictures have, too.

    Raises:
        MissingDependencyError: There is no scipy, which the intervals need.
    """
    section = measurement.sections[0]
    means, profiles = ((IMAGES / name.format(called)).as_posix() for name in (MEANS, PROFILES))
    about = {"name": section.name, "count": len(section.seeds), "file": f"{called.replace('-', '_')}.json"}
    out = [f"# Leaderboard: {section.name}", "", INTRODUCTION.format(**about), ABOUT[section.name]]
    out += ["## What it says", "", *sentences(section), ""]
    out += ["## All lines", "", f"![Geometric means of the cost ratio]({means})", ""]
    out += [*_main(section), "", f"- **Lost** is the share of runs in which the arm was {lost(section)} at some time."]
    out += [LEGEND, *fewer_episodes(section), *_medians(section)]
    out += ["## Performance profiles", "", f"![Performance profiles]({profiles})", "", PROFILE]
    out += [
        *_generalisation(measurement.sections[1:]),
        *_tuned(tuning),
        *_submitted(measurement),
        *conditions(measurement),
    ]
    return "\n".join(out) + "\n"


def _main(section: Section) -> list[str]:
    cost_ratios, spreads = section.cost_ratios(), section.spreads()
    head = ["policy", "kind", "foresight", "cost ratio", "95 %", "median", "p90", "worst"]
    head += [f"≤ {1e3 * w:g} mm" for w in WITHIN]
    head += ["lost", "p50 [µs]", "p99 [µs]", "seeds", "steps", "core-min"]
    lines = [[f"`{ORACLE}`", REFERENCE, "all", "1.000", NOTHING, *["1.000"] * 3, *[NOTHING] * 8]]
    best: set[str] = set()
    for line in section.ranked():
        spread, first = spreads[line.label], line.kind not in best
        best.add(line.kind)
        cells = [
            quoted(line),
            line.kind + (", tuned" if line.settings else ""),
            f"{line.preview:,}",
            number(spread.mean),
            between(cost_ratios[line.label]),
            *map(number, (spread.median, spread.p90, spread.worst)),
            *map(share, (*map(line.within, WITHIN), line.lost / line.runs)),
            *map(time, (line.time_p50_us, line.time_p99_us)),
            _seeds(line),
            *_cost(line),
        ]
        lines.append([f"**{cell}**" if first and column in (0, 3) else cell for column, cell in enumerate(cells)])
    return table(head, lines, text=(0, 1))


def _medians(section: Section) -> list[str]:
    cost_ratios, spreads = section.cost_ratios(), section.spreads()
    lines = [
        [
            quoted(line),
            number(spreads[line.label].median),
            between(cost_ratios[line.label], lambda values: interval(values, np.median)),
            runs(line, section),
            str(line.timed),
            time(line.time_first_us),
        ]
        for line in section.ranked()
    ]
    head = ["policy", "median", "95 %", "runs", "timed", "first call [µs]"]
    summary = "Intervals of the median, runs and first calls"
    return collapsed(summary, table(head, lines, text=(0,)))


def _generalisation(sections: Sequence[Section]) -> list[str]:
    if not sections:
        return []
    out = ["## Generalisation", ""]
    out += [
        "Agents and some solvers on scenarios that no solver was tuned on. Where the best known costs are not known, "
        f"costs are stated **relative to `{FORESIGHT}`**, to the lowest of its seeds on the same episode, and not as "
        "cost ratios: below 1 is better than that preset.",
        "",
    ]
    for one in sections:
        stated = "cost ratios" if one.best_known is not None else f"relative to `{FORESIGHT}`"
        out.append(f"- `{one.name}`: {sets.CHANGED[one.name][1]}; {episodes(one)}; {stated}.")
    heads = [text for one in sections for text in (f"`{one.name}`", "95 %", "worst", "lost")]
    entered = {line.label: line for one in sections for line in one.ranked()}
    cells = {name: [quoted(line), line.kind] for name, line in entered.items()}
    for one in sections:
        there = {line.label: line for line in one.lines}
        cost_ratios, spreads = one.cost_ratios(), one.spreads()
        for name, row in cells.items():
            row += _changed(there[name], cost_ratios[name], spreads[name]) if name in there else [NOTHING] * 4
    return [*out, "", *table(["policy", "kind", *heads], list(cells.values()), text=(0, 1)), ""]


def _changed(line: Line, cost_ratios: FloatArray, spread: Spread) -> list[str]:
    interval = between(cost_ratios) if line.runs > 1 else NOTHING
    return [number(spread.mean), interval, number(spread.worst), share(line.lost / line.runs)]


def _tuned(tuning: Tuning) -> list[str]:
    out = ["## Tuned solvers", ""]
    if not tuning.solvers:
        return [*out, f"No settings have been searched for this scenario: `{tuning.command}`.", ""]
    out += [
        f"Searched on {tuning.date}, with `{tuning.command}` of that day's version, on the first {tuning.episodes} "
        f"{tuning.split} episodes of `{tuning.scenario}`, for the lowest geometric mean of the total cost (which needs "
        "no best known cost: dividing by it changes no order). No test episode was played for it. The result is in "
        f"`baselines/data/tuned/{tuning.scenario}.json`; `{update(tuning.scenario)}` searches anew. No setting lets a "
        "solver look further ahead.",
        "",
    ]
    lines = [
        [
            f"`{one.spec}`",
            ", ".join(f"`{name}={value}`" for name, value in one.settings.items()) or "as it is",
            str(one.tried),
            number(one.default),
            number(one.tuned),
            number(one.tuned / one.default),
        ]
        for one in tuning.solvers
    ]
    head = ["solver", "settings", "tried", "cost as it is", "cost tuned", "ratio"]
    return [*out, *table(head, lines, text=(0, 1)), ""]


def _submitted(measurement: Measurement) -> list[str]:
    """What others have handed in; nothing where nobody has."""
    if not measurement.submissions:
        return []
    out = ["## Submissions", "", "Checked and scored by the [rules](rules.md); the digest is that of the files.", ""]
    lines = [
        [
            f"`{one.name}`",
            ", ".join(one.authors),
            " ".join(f"`{command}`" for command in one.commands).replace("|", r"\|"),
            ", ".join(one.tuned_on) or NOTHING,
            one.digest,
            one.date,
            str(one.foresight),
        ]
        for one in measurement.submissions
    ]
    head = ["name", "authors", "commands", "tuned on", "digest", "scored", "foresight"]
    return [*out, *table(head, lines, text=(0, 1, 2, 3, 4, 5)), ""]


def _seeds(line: Line) -> str:
    if line.learned:
        return str(len(line.seeds)) if line.benchmark else few(line)
    return f"{len(line.seeds)} of the policy" if line.seeds else DETERMINISTIC


def _cost(line: Line) -> tuple[str, str]:
    if line.training is None:
        return NOTHING, NOTHING
    steps, minutes = statistics.fmean(line.training.steps), statistics.fmean(line.training.core_minutes)
    return number(steps) if steps >= 1e6 else f"{steps:,.0f}", number(minutes)


def _plain(line: Line) -> str:
    """A line's name in plots."""
    if line.learned:
        return line.name if line.benchmark else f"{line.name} ({few(line)})"
    return label(short(line.name), line.settings)
