"""Khan and Tar 2020: adaptive inverse kinematics by abstract rotations, on an arm that is known imprecisely."""

from __future__ import annotations

from baselines.papers.khan import (
    background_claims,
    conclusion_claims,
    general_path_claims,
    level_path_claims,
    plant_claims,
    sign_claims,
    variant_claims,
)
from baselines.papers.khan.figures import FIGURES
from baselines.papers.paper import Paper

PAPER = Paper(
    "khan",
    "Khan, Tar 2020: fixed-point iteration with abstract rotations",
    FIGURES,
    (
        *level_path_claims.CLAIMS,
        *general_path_claims.CLAIMS,
        *variant_claims.CLAIMS,
        *conclusion_claims.CLAIMS,
        *plant_claims.CLAIMS,
        *background_claims.CLAIMS,
        *sign_claims.CLAIMS,
    ),
    readings=(
        "The generating functions of the nominal paths are not printed: q1 = 0.5 sin s, and q7 = 0.5 sin s with "
        "q8 = 0.5 sin 2s, s = 0 … 10 s.",
        "The 2× in Table 1 is included in the exact arm's axes.",
        "In the listing `B'*B` is a misprint for `A'*B`, without which nothing is orthogonal to B.",
        "`q_pp_max` and `epsa` are not printed; 1e3 and 1e-12 are taken.",
        "𝒩 is 8×8, without which eq. 3.16 does not fit together; the conclusion's 12 dimensions fit if 𝒩 turns "
        "ℱ (x - f) before J̃ᵀ, which is tested beside it.",
        "`J_Prev_a` in the call may be the Jacobian of the inner step before or of the grid point before; figures are "
        "drawn with that of each inner step, and the other reading is tested beside it.",
        "In eq. 2.8 it is not said how σ depends on the direction of the previous step: it changes where f - x has "
        "turned round, or where it has grown; both are tested.",
        "The Jacobian is the derivative of the 12 numbers of f, not the stacked tangents of eq. 4.19, and 8 columns "
        "have it of rank 6 at most.",
        "f is measured on the exact arm, and only J̃ is of the model.",
        "Figures show the grid points, each after its last inner step; the steps between are played, not drawn.",
        "How the orientation error is measured is not said; it is the geodesic angle here.",
        "Figure 3, 12 and 16 have the angle of the rotation from home besides, since the text speaks of it.",
    ),
)
