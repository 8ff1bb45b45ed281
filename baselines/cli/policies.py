"""The command ``ikgym policies``."""

from __future__ import annotations

from collections.abc import Sequence

from baselines.cli import listing


def main(arguments: Sequence[str]) -> int:
    """Prints all policies, or some in full.

    Args:
        arguments: Names, or options.

    Returns:
        The exit code.
    """
    return listing.main("policies", listing.POLICIES, arguments)
