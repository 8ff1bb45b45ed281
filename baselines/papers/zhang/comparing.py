"""Zhang 2020: when figures are the same and when one is smaller: one threshold each, for all claims alike."""

from __future__ import annotations

from collections.abc import Mapping

from baselines.papers.paper import Finding, verdict, verdict_by_condition

#: Results are the same where they are apart by less than this share.
SAME = 0.01
#: A figure is smaller than another, or larger, from this share of the larger one on.
CHANGE = 0.1

#: A figure before and after, by the condition in which both were taken.
Pairs = Mapping[str, tuple[float, float]]


def change(before: float, after: float) -> float:
    """How much a figure of at least 0 rises, as a share of the larger one; negative where it falls."""
    largest = max(before, after)
    return (after - before) / largest if largest > 0.0 else 0.0


def falls(pairs: Pairs, evidence: str) -> Finding:
    """The finding on a claim that a figure falls, in all conditions in which it changes by :data:`CHANGE` or more.

    Args:
        pairs: The figures, by condition; without any change the claim is contradicted.
        evidence: See :class:`Finding`.
    """
    numbers = {f"{name}, {which}": v for name, of in pairs.items() for which, v in zip(("from", "to"), of, strict=True)}
    holds = {name: rise < 0.0 for name, rise in decided(pairs).items()}
    return verdict_by_condition(holds, evidence, **numbers) if holds else verdict(False, evidence, **numbers)


def decided(pairs: Pairs) -> dict[str, float]:
    """The changes that count, by condition."""
    changes = {name: change(*of) for name, of in pairs.items()}
    return {name: rise for name, rise in changes.items() if abs(rise) >= CHANGE}


def in_words(pairs: Pairs) -> str:
    """Where a figure changes by how much, and in how many conditions it does not."""
    found = decided(pairs)
    rest = len(pairs) - len(found)
    parts = [f"{name}: {100 * rise:+.0f} %" for name, rise in sorted(found.items(), key=lambda item: item[1])]
    return "; ".join([*parts, f"less than {100 * CHANGE:.0f} % either way in {rest} of {len(pairs)} comparisons"])
