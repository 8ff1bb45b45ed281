"""The plant: what of a real arm, its drives and its sensors differs from the data sheet, and what is drawn of it."""

from __future__ import annotations

from ikgym.plant.draw import DrawnPlant
from ikgym.plant.plant import Plant

__all__ = ("DrawnPlant", "Plant")
