"""The data model of a reproduction: figures to draw again, claims, and the results of their tests."""

from __future__ import annotations

import dataclasses
import pathlib
import tomllib
from collections.abc import Callable, Mapping, Sequence
from types import ModuleType
from typing import Literal, NamedTuple

from matplotlib.figure import Figure

from baselines.papers.runs import Runs

#: *depends*: holds in one reading or condition that the text allows, and fails in another.
Verdict = Literal["reproduced", "contradicted", "depends", "not testable"]

#: Measured figures by name, with the unit at the end of the name: ``{"largest error [mm]": 1.3}``.
Figures = Mapping[str, float | Sequence[float]]

_SCALES = {"%": 1e2, "mm": 1e3, "mrad": 1e3, "µm": 1e6, "ms": 1e3, "µs": 1e6}


class Finding(NamedTuple):
    """The result of testing a claim.

    Attributes:
        holds: Whether the claim holds; by reading or condition if the text allows several; None if nothing in the text
            decides.
        figures: The figures that decide.
    """

    holds: bool | Mapping[str, bool] | None
    figures: Figures

    @property
    def verdict(self) -> Verdict:
        """The verdict. A claim is contradicted only if it fails in all readings."""
        if self.holds is None:
            return "not testable"
        outcomes = set(map(bool, self.holds.values() if isinstance(self.holds, Mapping) else (self.holds,)))
        if len(outcomes) > 1:
            return "depends"
        return "reproduced" if outcomes == {True} else "contradicted"

    @property
    def text(self) -> str:
        """The figures in one line, with units."""
        return "; ".join(_entry(name, value) for name, value in self.figures.items())


def _entry(name: str, value: float | Sequence[float]) -> str:
    name, _, unit = name.partition("[")
    values = ", ".join(map(_number, value if isinstance(value, Sequence) else (value,)))
    return " ".join(filter(None, (name.strip(), values, unit.removesuffix("]"))))


def _number(value: float) -> str:
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"


def in_unit(values: Figures, unit: str) -> dict[str, float | Sequence[float]]:
    """Figures in a unit such as ``"mm"`` or ``"%"``, from SI units or shares by name without the unit."""
    scale = _SCALES.get(unit, 1.0)
    return {
        f"{name} [{unit}]": [scale * v for v in value] if isinstance(value, Sequence) else scale * value
        for name, value in values.items()
    }


@dataclasses.dataclass(frozen=True)
class PaperFigure:
    """A figure of a paper.

    Args:
        number: Its number in the paper.
        title: Its subject.
        draw: Draws it from episodes.
    """

    number: int
    title: str
    draw: Callable[[Runs], Figure]


@dataclasses.dataclass(frozen=True)
class Claim:
    """A statement of a paper that can be tested.

    Args:
        name: A short name, unique within the paper.
        text: The claim in one sentence.
        where: Its place in the paper, for example ``"section IV, fig. 6"``.
        method: How it is tested here, with the threshold.
        test: Tests it on episodes.
        condition: If the verdict depends: when the claim holds. If it is not testable: why not.
    """

    name: str
    text: str
    where: str
    method: str
    test: Callable[[Runs], Finding]
    condition: str = ""


@dataclasses.dataclass(frozen=True)
class Paper:
    """A paper and its reproduction.

    Args:
        name: Its name on the command line.
        title: Authors, year and subject.
        figures: Its figures.
        claims: Its claims.
    """

    name: str
    title: str
    figures: tuple[PaperFigure, ...]
    claims: tuple[Claim, ...]


def claims_of(*modules: ModuleType) -> tuple[Claim, ...]:
    """The claims of ``claims.toml`` next to some modules, each tested by the function of the same name."""
    text = pathlib.Path(str(modules[0].__file__)).with_name("claims.toml").read_text(encoding="utf-8")
    tests = {name: value for module in modules for name, value in vars(module).items()}
    return tuple(Claim(name, test=tests[name], **record) for name, record in tomllib.loads(text).items())
