"""Moved to :mod:`baselines.files`."""

from baselines.files import LOCK as NAME
from baselines.files import locked

__all__ = ["NAME", "locked"]
