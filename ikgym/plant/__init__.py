"""The plant: deviations of arm, drives and sensors from the data sheet, and their random draws."""

from __future__ import annotations

from ikgym.plant.draw import DrawnPlant
from ikgym.plant.plant import Plant

__all__ = ("DrawnPlant", "Plant")
