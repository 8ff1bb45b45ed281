"""What the numbers say, in sentences that are worked out from them."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from baselines.evaluation.pages.measurement import AGENT, FAR, NEAR, Line, Section
from baselines.evaluation.pages.statistics import geometric_interval
from baselines.evaluation.report import number
from ikgym.validation import FloatArray


@dataclasses.dataclass(frozen=True)
class Comparison:
    """A line beside another one on the same episodes.

    Args:
        ratio: Geometric mean of its cost divided by the other's.
        low: Lower end of its interval, see :func:`baselines.evaluation.pages.statistics.interval`.
        high: Upper end.
    """

    ratio: float
    low: float
    high: float

    @classmethod
    def of(cls, one: FloatArray, other: FloatArray) -> Comparison:
        """Compares episode by episode, with the geometric mean of the other's seeds, if it has several.

        Where one has played fewer episodes, the first ones, both are compared on those.
        """
        shared = min(one.shape[1], other.shape[1])
        ratios = one[:, :shared] / np.exp(np.log(other[:, :shared]).mean(axis=0))
        return cls(float(np.exp(np.log(ratios).mean())), *geometric_interval(ratios))

    def __str__(self) -> str:
        return f"{number(self.ratio)} ({number(self.low)} to {number(self.high)})"


class Mean(NamedTuple):
    """A geometric mean and its interval."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{number(self.mean)}, {number(self.low)} to {number(self.high)}"


def sentences(section: Section) -> list[str]:
    """What the main set says of agents beside solvers, as lines of Markdown; each mean with its interval of 95 %."""
    cost_ratios = section.cost_ratios()
    means = {
        label: Mean(spread.mean, *geometric_interval(cost_ratios[label])) for label, spread in section.spreads().items()
    }
    ranked = section.ranked()
    # An agent with too few seeds says something only where there is no other.
    learned = [line for line in ranked if line.learned]
    learned = [line for line in learned if line.benchmark] or learned
    near = [line for line in ranked if line.kind == NEAR]
    far = [line for line in ranked if line.kind == FAR]
    if not learned:
        return ["- No agent has been entered: the lines are those of solvers.", *_solvers(near, far, means)]
    beside = {line.label: _beside_base(line, ranked, cost_ratios) for line in learned}
    out = [*_solvers(near, far, means)]
    out += [
        f"- {_name(line, means)} corrects `{line.training.base_policy}` and costs {beside[line.label]} times as much "
        "as that solver alone: it is in the table, and not compared with others here."
        for line in learned
        if line.training and _fails(beside[line.label])
    ]
    learned = [line for line in learned if not _fails(beside[line.label])]
    if not learned:
        return [*out, "- No agent is better than the solver that it corrects, and none stands alone."]
    best = learned[0]
    out += [f"- The best agent is {_name(best, means)}{_few(best)}; it loses track in {best.lost} of {best.runs} runs."]
    if best.training and best.training.base_policy:
        out.append(
            f"- It adds to `{best.training.base_policy}` and sees {best.preview} steps ahead: what that solver reaches "
            "is no merit of the training. Compare it with the same solver alone."
        )
    alone = next((line for line in learned if line.kind == AGENT), None)
    if alone is None:
        out.append("- No agent stands alone, without a solver under it.")
    elif alone is not best:
        out.append(f"- The best without a solver under it is {_name(alone, means)}{_few(alone)}.")
    if near:
        out.append(_beside_near(best, near, cost_ratios, means))
    ratios = [Comparison.of(cost_ratios[best.label], cost_ratios[line.label]) for line in far]
    return out + [
        f"- Its cost is {r} times that of {_name(line, means)}, which looks {line.preview:,} steps ahead."
        for r, line in zip(ratios, far, strict=True)
    ]


def _beside_base(line: Line, ranked: list[Line], cost_ratios: dict[str, FloatArray]) -> Comparison | None:
    """A residual agent beside its base policy alone; None for others, and where that was not played."""
    base = line.training.base_policy if line.training else None
    alone = next((other for other in ranked if other.name == base and not other.settings), None)
    return None if alone is None else Comparison.of(cost_ratios[line.label], cost_ratios[alone.label])


def _fails(beside: Comparison | None) -> bool:
    """Whether the costs of a residual agent are not below those of its base policy with their whole interval."""
    return beside is not None and beside.high >= 1.0


def _beside_near(best: Line, near: list[Line], cost_ratios: dict[str, FloatArray], means: dict[str, Mean]) -> str:
    lower = [line for line in near if means[line.label].mean <= means[best.label].mean]
    first = near[0]
    ratio = Comparison.of(cost_ratios[best.label], cost_ratios[first.label])
    if lower:
        names = ", ".join(_name(line, means) for line in lower)
        return (
            "- The best agent is **not** below every solver that looks no further than the paper's horizon: "
            f"{len(lower)} of {len(near)} are as low or lower, namely {names}. Its cost is {ratio} times that of the "
            "best of them."
        )
    return (
        f"- The best agent is below all {len(near)} solvers that look no further than the paper's horizon: its cost is "
        f"{ratio} times that of the best of them, {_name(first, means)}."
    )


def _solvers(near: list[Line], far: list[Line], means: dict[str, Mean]) -> list[str]:
    out = []
    for line, how in [*((one, "no further than the paper's horizon") for one in near[:1])] + [
        (one, f"further, {one.preview:,} steps ahead,") for one in far[:1]
    ]:
        out.append(
            f"- The best solver that looks {how} is {_name(line, means)}; it loses track in {line.lost} of {line.runs} "
            "runs."
        )
    return out


def _name(line: Line, means: dict[str, Mean]) -> str:
    return f"{quoted(line)} ({means[line.label]})"


def quoted(line: Line) -> str:
    """A line's name in Markdown: solvers as code."""
    tail = ", tuned" if line.settings else ""
    return line.name if line.learned else f"`{line.name}`{tail}"


def _few(line: Line) -> str:
    return "" if line.benchmark else f" ({few(line)})"


def few(line: Line) -> str:
    """What has to be said of an agent with too few seeds."""
    return f"{len(line.seeds)} seed{'s' * (len(line.seeds) > 1)}: not a benchmark"
