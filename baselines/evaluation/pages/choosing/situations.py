"""Situations in which somebody has to choose a solver, and how the solvers stand in each."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np

from baselines.evaluation.pages import sets
from baselines.evaluation.pages.measurement import Line, Section
from baselines.evaluation.summary import geometric_mean
from ikgym.validation import FloatArray

#: Errors up to this, in [mm] or [mrad], are as good as none: a tenth of what costs 1.
SMALL = 0.1
#: Who is at most so much above the lowest is as good: the faster one is named.
EQUAL = 1.05
#: What is compared: the largest error, or the cost of a whole episode.
ERROR, COST = "error", "cost"


@dataclasses.dataclass(frozen=True)
class Situation:
    """Something that an engineer knows of a task.

    Args:
        name: In a few words.
        meaning: What was played, in a sentence.
        sets: See :func:`baselines.evaluation.pages.sets.get`.
        by: What solvers are compared by, :data:`ERROR` or :data:`COST`.
    """

    name: str
    meaning: str
    sets: tuple[str, ...]
    by: str = ERROR

    def among(self, sections: Iterable[Section]) -> list[Section]:
        """What of it was played."""
        return [one for one in sections if one.name in self.sets]


FEASIBLE = ("circle", "lemniscate", "square", "raster", "line")

SITUATIONS = (
    Situation(
        "nothing stands in the way",
        "Circle, lemniscate, square, raster and line of `panda` and `iiwa14`, which can be followed within all limits.",
        sets.paths(*FEASIBLE, of=("panda", "iiwa14")),
    ),
    Situation(
        "one joint is much slower than the others",
        "The same paths of `tiago`, whose torso is slow and must be spared.",
        sets.paths(*FEASIBLE, of=("tiago",)),
    ),
    Situation(
        "the rotation about the tool's axis is free",
        "A square with the tool upright, in task `axis`.",
        sets.paths("glue"),
    ),
    Situation(
        "a joint limit stands in the way",
        "The tool turns by more than the last joint has left, and no solver follows: the error that remains counts. "
        "The best known motion, planned over the whole path, follows on `panda`, but not on `iiwa14` and `tiago`.",
        sets.paths("turn"),
    ),
    Situation(
        "the path is faster than the joints",
        "The circle, faster than any posture allows within the velocity limits: no solver can follow.",
        sets.paths("fast"),
    ),
    Situation(
        "singular postures",
        "Through a posture with a stretched elbow and one with an aligned wrist.",
        sets.paths("singular"),
    ),
    Situation(
        "the path leads beyond the reach",
        "A circle whose farthest point is out of reach.",
        sets.paths("edge"),
    ),
    Situation(
        "acceleration limits are tight",
        f"Square, raster and line of `panda` with {100.0 * sets.GENTLE:g} % of its acceleration limits.",
        sets.GENTLE_PATHS,
    ),
    Situation(
        "the model is nominal, the arm as it was built",
        "The circle with five Pandas whose kinematics were measured; solvers know the nominal ones.",
        tuple(f"{arm}-circle" for arm in sets.CALIBRATED),
    ),
    Situation(
        "the tool is not known",
        f"The circle with a tool {sets.LONGER:g} m longer and turned by {np.degrees(sets.TURNED):.0f}°. Solvers "
        "do not know it, and the pose that they measure is that of the tool.",
        ("panda-tool-circle",),
    ),
    Situation(
        "the whole motion is to be cheap",
        "Random motions that keep all limits, where foresight can use the redundancy; compared by their cost.",
        ("panda-random", "iiwa14-random"),
        COST,
    ),
)


@dataclasses.dataclass(frozen=True)
class Standing:
    """How a solver stands in a situation.

    Args:
        label: Of the solver.
        error: Its largest error in [mm] or [mrad], whichever is larger.
        above: Its largest error divided by the lowest of all solvers, both at least :data:`SMALL`; the largest of the
            scenarios.
        cost: Its cost divided by the lowest of all solvers in the same episode; geometric mean.
        held_back: The share of the steps in which a stop, a velocity and an acceleration limit held a joint back.
        p50: The largest median time of a call, in [µs].
        p99: The largest 99th percentile.
    """

    label: str
    error: float
    above: float
    cost: float
    held_back: tuple[float, float, float]
    p50: float
    p99: float

    def by(self, what: str) -> float:
        """What it is compared by."""
        return self.above if what == ERROR else self.cost


def standings(situation: Situation, sections: Iterable[Section]) -> list[Standing]:
    """How the solvers stand that have played all scenarios of a situation, the best first; none if it was not played.

    Args:
        situation: Which one.
        sections: All that was measured.
    """
    return ranked(situation.among(sections), situation.by)


def ranked(played: Sequence[Section], by: str) -> list[Standing]:
    """How the solvers stand that have played all of these scenarios, the best first."""
    everywhere = [label for label in _labels(played[:1]) if all(label in _labels([one]) for one in played)]
    found = [_standing(label, played) for label in everywhere]
    return sorted(found, key=lambda one: (one.by(by), one.p50))


def chosen(standings: Sequence[Standing], by: str = ERROR) -> Standing:
    """Who is named: the fastest of those that are as good as the best of those that ran into no stop.

    Args:
        standings: At least one.
        by: What they are compared by.
    """
    free = [one for one in standings if one.held_back[0] == 0.0] or list(standings)
    best = min(one.by(by) for one in free)
    return min((one for one in free if one.by(by) <= EQUAL * best), key=lambda one: one.p50)


def _labels(sections: Iterable[Section]) -> list[str]:
    return [line.label for one in sections for line in one.lines]


def _standing(label: str, played: Sequence[Section]) -> Standing:
    lines = [next(line for line in one.lines if line.label == label) for one in played]
    worst = [largest_error(line) for line in lines]
    least = [min(map(largest_error, one.lines)) for one in played]
    steps = sum(line.runs * sets.get(one.name).steps for line, one in zip(lines, played, strict=True))
    held = np.sum([line.held or (0, 0, 0) for line in lines], axis=0) / steps
    costs = [cost for line, one in zip(lines, played, strict=True) for cost in relative_cost(line, one).ravel()]
    return Standing(
        label,
        max(worst),
        max(max(SMALL, e) / max(SMALL, low) for e, low in zip(worst, least, strict=True)),
        geometric_mean(costs),
        (float(held[0]), float(held[1]), float(held[2])),
        max(line.time_p50_us or np.inf for line in lines),
        max(line.time_p99_us or np.inf for line in lines),
    )


def largest_error(line: Line) -> float:
    """The largest error of all episodes of a line, in [mm] or [mrad], whichever is larger."""
    return 1e3 * max(float(np.max(values)) for values in (line.error, line.angle) if values is not None)


def relative_cost(line: Line, section: Section) -> FloatArray:
    """The cost of each episode of a line by the lowest of all lines, over the episodes that all have played."""
    shared = min(other.episodes for other in section.lines)
    lowest = np.min([np.min(np.array(other.cost)[:, :shared], axis=0) for other in section.lines], axis=0)
    out: FloatArray = np.array(line.cost)[:, :shared] / lowest
    return out
