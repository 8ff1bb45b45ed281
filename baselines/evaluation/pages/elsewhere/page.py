"""The page as Markdown."""

from __future__ import annotations

import collections
import math
from collections.abc import Iterable, Sequence

import numpy as np

from baselines.evaluation.pages.elsewhere.followed import ORIENTATION, POSITION, SLIDE, TURN, Followed
from baselines.evaluation.pages.elsewhere.played import Measured, Run
from baselines.evaluation.pages.markdown import table
from baselines.evaluation.pages.markdown import time as microseconds
from baselines.evaluation.report import NOTHING, number
from ikgym import problems, scenarios
from ikgym.scenarios import elsewhere

INTRODUCTION = f"""\
Paths that others published, followed by policies of this project, beside the joint trajectories that were published for
them: [MinsungYoon/RL-ITG](https://github.com/MinsungYoon/RL-ITG) (MIT; Yoon et al., ICRA 2023; Fetch arm) and
[jstmn/cppflow](https://github.com/jstmn/cppflow) (MIT; Morgan, Millard and Sukhatme, ICRA 2024; Fetch arm with and
without its torso, Panda). [How they became scenarios](scenarios.md#problems-from-elsewhere). Written by
`python -m baselines.evaluation.pages.elsewhere`; everything below is worked out from what was measured, which lies in
[elsewhere.json](elsewhere.json).

An **initial trajectory** is what RL-ITG hands to an optimiser (TORM) to begin with: greedy IK, behaviour cloning or
reinforcement learning. None of them claims to be a solution. They are scored as published, by our kinematics alone:
no arm was moved, no limit acted. **Policies** are no planners: they see a stretch of the path ahead, once, while the
arm moves, within its position and velocity limits.

**Passes** are CppFlow's thresholds at all waypoints, the first one included: less than {1e3 * POSITION:g} mm and
{math.degrees(ORIENTATION):g}° away, less than {math.degrees(TURN):g}° in a revolute and {1e2 * SLIDE:g} cm in a
prismatic joint from waypoint to waypoint, and within the limits. CppFlow asks for no collisions besides, and chooses
its start; neither is done here. **Length** adds up the changes of all revolute joints from waypoint to waypoint.
**Stop** and **velocity** count the control steps, {elsewhere.STEPS} a waypoint, in which one
held a joint back.

Of the paths that each has followed:
"""
CAVEATS = """\
- A waypoint every {period:g} s, {steps} control steps from one to the next, the thresholds at the waypoints only.
- Starts: the first one that RL-ITG publishes for a path. CppFlow prescribes none: of {postures} solutions from random
  postures, the one farthest from the limits; another start can turn a failure into a success, and the other way round.
- Times were taken while other processes shared the machine, one call of `predict` at a time."""
HEAD = ["", "passes", "position [mm]", "orientation [°]", "joint step [°]", "torso step [cm]", "beyond limits"]
TAIL = ["length [rad]", "stop", "velocity", "p50 [µs]"]
RANDOM_HEAD = ["", "passes", "position [mm]", "worst", "orientation [°]", "worst", "joint step [°]", "worst"]
RANDOM_HEAD += [TAIL[0], "beyond limits", *TAIL[1:]]
RANDOM_WORDS = """\
Of each path's largest error and largest joint step the median over the paths, and the worst; of lengths and times the
median; on how many paths joints were beyond their limits, or held back by a stop or a velocity limit."""


def page(measured: Measured) -> str:
    """The page."""
    by_problem: dict[str, list[Run]] = collections.defaultdict(list)
    for one in measured.runs:
        by_problem[one.problem].append(one)
    drawn = [name for name in scenarios.problems_from_elsewhere() if name in by_problem]
    random = [one for name in problems.names(f"{elsewhere.RANDOM}-") for one in by_problem[name]]
    out = ["# Problems from elsewhere", "", INTRODUCTION, *_sentences(measured), ""]
    out += ["## The hundred random paths of RL-ITG", "", RANDOM_WORDS, "", *_random(random), ""]
    for name in drawn:
        scenario = scenarios.get(name)
        about = f"`{scenario.arm.name}`, {len(problems.waypoints(name).positions)} waypoints"
        out += [f"## `{name}`", "", f"{about}.{_note(name)}", "", *_drawn(by_problem[name]), ""]
    return "\n".join([*out, *_conditions(measured)]) + "\n"


def called(who: str) -> str:
    """What a run is called."""
    return f"initial trajectory: {problems.METHODS[who]}" if who in problems.METHODS else f"`{who}`"


def _sentences(measured: Measured) -> list[str]:
    """Who passes how often."""
    out = []
    for who in _names(measured.runs):
        own = [one for one in measured.runs if one.who == who]
        passed = sum(one.followed.passes for one in own)
        out.append(f"- {called(who)} passes on {passed} of {len(own)} paths.")
    return out


def _drawn(runs: Sequence[Run]) -> list[str]:
    lines = []
    for one in runs:
        found = one.followed
        torso = number(found.slide, 1e2) if found.slide else NOTHING
        cells = [called(one.who), _verdict(found), *_errors(found), torso, number(found.beyond), number(found.length)]
        lines.append([*cells, _count(one.at_stop), _count(one.at_velocity_limit), microseconds(one.time_p50_us)])
    return table([*HEAD, *TAIL], lines, text=(0,))


def _random(runs: Sequence[Run]) -> list[str]:
    """Everybody on the paths that all have followed, and where that is not all of them, those who have followed all."""
    by_who = {who: {one.problem: one for one in runs if one.who == who} for who in _names(runs)}
    common = set.intersection(*(set(found) for found in by_who.values())) if by_who else set()
    most = max(map(len, by_who.values()), default=0)
    shared = [[found[name] for name in sorted(common)] for found in by_who.values()]
    whole = [list(found.values()) for found in by_who.values() if len(found) == most]
    out = [f"The first {len(common)} paths, which everybody has followed:" if len(common) < most else "", ""]
    out += _spreads(shared)
    if len(common) < most:
        out += ["", f"All {most}, by those who have followed them:", "", *_spreads(whole)]
    return out


def _spreads(groups: Sequence[Sequence[Run]]) -> list[str]:
    """Medians and worst over paths, a line for each group of runs."""
    lines = []
    for own in groups:
        found = [one.followed for one in own]
        cells = [called(own[0].who), f"{sum(one.passes for one in found)} of {len(found)}"]
        for values, scale in (
            ([one.position_error for one in found], 1e3),
            ([one.orientation_error for one in found], 180.0 / math.pi),
            ([one.turn for one in found], 180.0 / math.pi),
        ):
            cells += [number(float(np.median(values)), scale), number(max(values), scale)]
        cells.append(number(float(np.median([one.length for one in found]))))
        cells += [str(sum(one.beyond > 0.0 for one in found))]
        cells += [_paths(one.at_stop for one in own), _paths(one.at_velocity_limit for one in own)]
        times = [one.time_p50_us for one in own if one.time_p50_us is not None]
        lines.append([*cells, microseconds(float(np.median(times)) if times else None)])
    return table(RANDOM_HEAD, lines, text=(0,))


def _errors(found: Followed) -> list[str]:
    return [
        number(found.position_error, 1e3),
        number(math.degrees(found.orientation_error)),
        number(math.degrees(found.turn)),
    ]


def _verdict(found: Followed) -> str:
    return "yes" if found.passes else "no"


def _count(steps: int | None) -> str:
    return NOTHING if steps is None else f"{steps:,}"


def _paths(steps: Iterable[int | None]) -> str:
    known = [one for one in steps if one is not None]
    return str(sum(one > 0 for one in known)) if known else NOTHING


def _names(runs: Iterable[Run]) -> list[str]:
    """Everybody, in the order in which they were measured."""
    return list(dict.fromkeys(one.who for one in runs))


def _note(name: str) -> str:
    """What is to be known about a path."""
    out = scenarios.get(name).arm
    reached = elsewhere.unreached(name)
    if not len(reached):
        return ""
    which = f"{len(reached)} of them, {reached[0]} to {reached[-1]} counted from 0"
    return (
        f" As far as `Arm.inverse` finds, {which}, are out of reach of `{out.name}` within its limits: nobody can pass."
    )


def _conditions(measured: Measured) -> list[str]:
    machine = ", ".join(f"{name} {value}" for name, value in measured.machine.items())
    caveats = CAVEATS.format(period=elsewhere.PERIOD, steps=elsewhere.STEPS, postures=elsewhere.POSTURES)
    out = ["## Conditions", "", f"- command: `{measured.command}`", f"- date: {measured.date}", f"- machine: {machine}"]
    return [*out, caveats]
