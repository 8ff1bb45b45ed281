"""What can go wrong in a training that is nobody's bug."""

from __future__ import annotations

from ikgym.exceptions import IkgymError


class TrainingError(IkgymError):
    """A run cannot be begun, resumed or repeated, or its numbers are no longer finite."""
