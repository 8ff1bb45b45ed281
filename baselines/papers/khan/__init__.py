"""Khan and Tar 2020: adaptive inverse kinematics by abstract rotations, on an arm that is known imprecisely."""

from __future__ import annotations

from baselines.papers.khan import claims
from baselines.papers.khan.figures import FIGURES
from baselines.papers.paper import Paper, claims_of

PAPER = Paper("khan", "Khan, Tar 2020: fixed-point iteration with abstract rotations", FIGURES, claims_of(claims))
