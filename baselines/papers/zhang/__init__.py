"""Zhang 2020: Levenberg and Marquardt's iteration as model-free adaptive (predictive) control."""

from __future__ import annotations

from baselines.papers.paper import Paper
from baselines.papers.zhang import (
    adaptive_claims,
    damping_claims,
    example_claims,
    iteration_claims,
    plant_claims,
    predictive_claims,
    robustness_claims,
    smoothness_claims,
    timing_claims,
)
from baselines.papers.zhang.figures import FIGURES

PAPER = Paper(
    "zhang",
    "Zhang 2020: inverse kinematics by Levenberg–Marquardt and model-free adaptive (predictive) control",
    FIGURES,
    (
        *adaptive_claims.CLAIMS,
        *robustness_claims.CLAIMS,
        *plant_claims.CLAIMS,
        *iteration_claims.CLAIMS,
        *damping_claims.CLAIMS,
        *predictive_claims.CLAIMS,
        *smoothness_claims.CLAIMS,
        *example_claims.CLAIMS,
        *timing_claims.CLAIMS,
    ),
    readings=(
        "The same is less than 1 % apart, and a figure is larger or smaller from 10 % of the larger one on, in all "
        "comparisons.",
        "Example 1 is `mfapc_helix`, what is left of it without prediction `mfac_helix`, and example 2 `mfapc_line`.",
        "λ is added to JᵀJ as it is, not squared.",
        "Eq. 42 has a misplaced parenthesis; meant is x = (l₂ s₂ + l₃ s₂₃) c₁, and y likewise.",
        "The first measurement of example 1 is y(1) = 0 although q = 0 says otherwise; the model that the controller "
        "has for J is right from the first sample on.",
        "In (44) the error is that of all n points from the pose measured, and what it does to λ shows in the next "
        "sample; λ(1) = 2.",
        "The text says that figure 2 shows MFAC; it is drawn with the MFAPC that the example describes.",
        "Example 2 has a robot whose parameters are not printed; the Puma 560 stands in.",
        "Times of the line are not printed: T = 2 s with blends of 0.5 s; sample 1 is the start, a sample is 1 ms.",
        "α, β, γ of figure 6 are drawn as the rotation vector from the first orientation, as (54) has it, and by "
        "atan2 instead of the printed arccos.",
        "The tracking error of figure 7 is printed as y*(k+1) − y(k), which contains the way of one period; that is "
        "drawn on the left, and y*(k) − y(k) on the right.",
        "The test (40) is of the whole horizon; figure 9 shows beside it the iterations until the first point is met.",
        "The values of Table I, of (37) and of (18) are not printed and were found by trial, scaled by the typical "
        "link l, the mean of all links: 6.33 m in example 1.",
        "In remark 3 a clause on what the error correlates with can be read to end before cond(J), or behind it.",
        "In remark 3 “λ(k)₍ᵢ₎ = 0” is taken to mean ≠ 0, as the sentence makes no sense otherwise.",
        "Poses and ways of example 1 have no unit; they are taken to be in metres.",
    ),
)
