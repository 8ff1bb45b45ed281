"""Zhang 2020: Levenberg and Marquardt's iteration as model-free adaptive (predictive) control."""

from __future__ import annotations

from baselines.papers.paper import Paper, claims_of
from baselines.papers.zhang import claims
from baselines.papers.zhang.figures import FIGURES

PAPER = Paper(
    "zhang",
    "Zhang 2020: inverse kinematics by Levenberg–Marquardt and model-free adaptive (predictive) control",
    FIGURES,
    claims_of(claims),
)
