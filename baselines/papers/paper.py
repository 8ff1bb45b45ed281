"""What a reproduction is made of: figures to draw again, and claims to test."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from baselines.papers.runs import Runs
from ikgym.validation import FloatArray

#: *depends*: holds in one reading or condition that the text allows and fails in another; the evidence says which.
Verdict = Literal["reproduced", "contradicted", "depends", "not testable"]


class Drawn(NamedTuple):
    """A figure drawn again.

    Attributes:
        figure: The picture.
        numbers: What can be said of it in numbers, by name; units stand in the names, as in ``max_error_mm``.
    """

    figure: Figure
    numbers: dict[str, Any]


class Finding(NamedTuple):
    """What the test of a claim found.

    Attributes:
        verdict: Whether the claim holds. A contradicted claim is a result.
        evidence: The figures that show it, in one line with units.
        numbers: The same by name, for machines.
    """

    verdict: Verdict
    evidence: str
    numbers: dict[str, Any]


def verdict(holds: bool | np.bool_, evidence: str, /, **numbers: Any) -> Finding:
    """The finding that a claim is reproduced if it holds, and contradicted if not."""
    return Finding("reproduced" if holds else "contradicted", evidence, numbers)


def verdict_by_condition(holds: Mapping[str, bool | np.bool_], evidence: str, /, **numbers: Any) -> Finding:
    """The finding on a claim that was tested in several readings or conditions, all of which the text allows.

    Args:
        holds: Whether the claim holds, by reading or condition.
        evidence: See :class:`Finding`; says which reading or condition does what.
        **numbers: The same by name.
    """
    if len(set(map(bool, holds.values()))) == 1:
        return verdict(all(holds.values()), evidence, **numbers)
    return Finding("depends", evidence, numbers)


def rms(values: FloatArray) -> float:
    """Root mean square, in the unit of the values."""
    return float(np.sqrt(np.mean(np.square(values))))


def roughness(values: FloatArray) -> float:
    """Root mean square of the second differences, in the unit of the values."""
    return rms(np.diff(values, 2, axis=0))


@dataclasses.dataclass(frozen=True)
class PaperFigure:
    """A figure of a paper.

    Args:
        number: Its number in the paper.
        title: What it shows.
        draw: Draws it from episodes.
    """

    number: int
    title: str
    draw: Callable[[Runs], Drawn]


@dataclasses.dataclass(frozen=True)
class Claim:
    """What a paper says that can be tested.

    Args:
        name: A short name, unique within the paper.
        text: What is claimed, in one sentence.
        where: Where it stands, for example ``"section IV, Fig. 6"``.
        how: How it is tested here.
        test: Tests it on episodes.
    """

    name: str
    text: str
    where: str
    how: str
    test: Callable[[Runs], Finding]


@dataclasses.dataclass(frozen=True)
class Paper:
    """A paper and what is reproduced of it.

    Args:
        name: What the command line calls it.
        title: Authors, title and year.
        figures: Its figures.
        claims: Its claims.
        readings: How places are read where the paper is silent, ambiguous or misprinted, one sentence each.
    """

    name: str
    title: str
    figures: tuple[PaperFigure, ...]
    claims: tuple[Claim, ...]
    readings: tuple[str, ...]
