"""Varga, Issa, Horváth and Tar 2021: the receding horizon without Lagrange multipliers."""

from __future__ import annotations

from baselines.papers.paper import Paper
from baselines.papers.varga.claims import CLAIMS
from baselines.papers.varga.figures import FIGURES

PAPER = Paper(
    "varga",
    "Varga, Issa, Horváth, Tar 2021: receding horizon without Lagrange multipliers",
    FIGURES,
    CLAIMS,
    readings=(
        "Eq. 6 read literally makes axes 4 and 5 coaxial; each segment follows its joint in `varga7`, and stands "
        "before it in `varga7_literal`. Figures and claims are those of `varga7`.",
        "The sum over q̇ runs over all 7 joints; the printed 6 is a slip.",
        "A horizon of HL = 3 has two free velocity vectors; grid point 1 is the present.",
        "Whether α starts anew in each control step or is kept, and whether the warm start is shifted, is not said; "
        "figures are drawn with α restarted at 1e-8 and the warm start unshifted, where the printed bounds of α work.",
        "Eq. 3 for this task has the task coordinates X as unknowns beside q and q̇, held to X = F(q) by constraints.",
        "Eq. 16 lacks a dot: q̈ˢ = Λ²(q − qˢ) − 2Λ q̇ˢ.",
        "The third panel of figure 6 (a symbol is lost in print) is taken to be α.",
    ),
)
