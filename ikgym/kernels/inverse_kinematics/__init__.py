"""Kernels: joint coordinates for a pose, by Levenberg–Marquardt steps within the limits, from one start after another.

The error is e = (position, length · rotation vector) in the base frame, J its Jacobian. A step minimises
|e - J Δq|² + λ |Δq|² with λ in proportion to |e|² (Chan and Lawrence 1988; Sugihara 2011): cautious far from the pose,
a Gauss–Newton step with its quadratic convergence close to it. A joint that a step would take past a limit goes there
and no further, and the other joints make up for the rest.
"""

from __future__ import annotations

from ikgym.kernels.inverse_kinematics.numbers import Ranges, Settings
from ikgym.kernels.inverse_kinematics.postures import inverse_rows

__all__ = ("Ranges", "Settings", "inverse_rows")
