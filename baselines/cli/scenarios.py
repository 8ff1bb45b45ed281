"""The command ``ikgym scenarios``."""

from __future__ import annotations

from collections.abc import Sequence

from baselines.cli import listing


def main(arguments: Sequence[str]) -> int:
    """Prints all scenarios, or some in full.

    Args:
        arguments: Names, or options.

    Returns:
        The exit code.
    """
    return listing.main("scenarios", listing.SCENARIOS, arguments)
