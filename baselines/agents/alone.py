"""Agents that act alone."""

from __future__ import annotations


class Alone:
    """What the processing of an agent has that corrects nobody, and whose outputs are taken as they are."""

    @property
    def base_policy(self) -> None:
        """There is none."""
        return

    @property
    def null_space(self) -> None:
        """Outputs go through no projector."""
        return
