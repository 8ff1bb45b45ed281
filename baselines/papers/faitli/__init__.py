"""Faitli and Tar 2018: inverse kinematics by a quasi-differential fixed-point transformation."""

from __future__ import annotations

from baselines.papers.faitli import method_claims, simulation_claims
from baselines.papers.faitli.figures import FIGURES
from baselines.papers.paper import Paper

PAPER = Paper(
    "faitli",
    "Faitli, Tar 2018: quasi-differential fixed-point transformation",
    FIGURES,
    (*simulation_claims.CLAIMS, *method_claims.CLAIMS),
    readings=(
        "No trajectory is printed; figures are those of `faitli3-stretched`, which passes the stretched elbow six "
        "times, and `faitli3-regular` and `faitli3-shoulder` are tested besides.",
        "The iterations per grid point are not printed; 10 are made.",
        "Eq. 1 is printed for f(q) - x, the text recommends x̃ = Jᵀ f(q); figures are drawn with Jᵀ.",
        "Eq. 1 adds a vector of the Cartesian space to q, which fits with n = m only, and with Jᵀ always.",
        "With F(ξ) = ξ/2 + D the fixed point is ξ* = 2D, and the step is q + (A/2) Jᵀ(f(q) - x): D cancels.",
        "Figure 6 is drawn along the calculated and the nominal joint path, on `faitli3-stretched`, whose calculated "
        "path meets no singular point, and beside it on `faitli3-shoulder`, whose calculated path passes several, as "
        "the text has it; with the smallest singular value below, as a real part can be zero where no eigenvalue is.",
        "With the end point of link 2 A is the -1 of Table 1, too, which the paper does not repeat there; the policy's "
        "default is what is sure to contract, -4/‖J‖² with a bound of the longer Jacobian: -0.815 on this arm.",
        "The end point of link 2 follows from the nominal joint path, as in the paper, which makes it in joint space.",
    ),
)
