"""The error of trainings that cannot be carried out."""

from __future__ import annotations

from ikgym.exceptions import IkgymError


class TrainingError(IkgymError):
    """A run cannot begin or be repeated, or its weights diverged."""
