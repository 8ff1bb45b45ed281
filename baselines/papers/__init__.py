"""The four papers: their figures and claims."""

from __future__ import annotations

from baselines.papers.faitli import claims as faitli_claims
from baselines.papers.faitli.figures import FIGURES as FAITLI_FIGURES
from baselines.papers.khan import claims as khan_claims
from baselines.papers.khan import without_jacobian
from baselines.papers.khan.figures import FIGURES as KHAN_FIGURES
from baselines.papers.paper import Paper, claims_of
from baselines.papers.varga import claims as varga_claims
from baselines.papers.varga.figures import FIGURES as VARGA_FIGURES
from baselines.papers.zhang import claims as zhang_claims
from baselines.papers.zhang import predictive
from baselines.papers.zhang.figures import FIGURES as ZHANG_FIGURES
from ikgym.validation import known_name

_TITLES = {
    "varga": "Varga, Issa, Horváth, Tar 2021: receding horizon without Lagrange multipliers",
    "faitli": "Faitli, Tar 2018: quasi-differential fixed-point transformation",
    "khan": "Khan, Tar 2020: fixed-point iteration with abstract rotations",
    "zhang": "Zhang 2020: inverse kinematics by Levenberg–Marquardt and model-free adaptive (predictive) control",
}
_CLAIMS = {
    "varga": claims_of(varga_claims),
    "faitli": claims_of(faitli_claims),
    "khan": claims_of(khan_claims, without_jacobian),
    "zhang": claims_of(zhang_claims, predictive),
}
_FIGURES = {"varga": VARGA_FIGURES, "faitli": FAITLI_FIGURES, "khan": KHAN_FIGURES, "zhang": ZHANG_FIGURES}

PAPERS = {name: Paper(name, title, _FIGURES[name], _CLAIMS[name]) for name, title in _TITLES.items()}


def get(name: str) -> Paper:
    """The paper with a name.

    Raises:
        UnknownNameError: There is no such paper.
    """
    known_name("paper", name, PAPERS)
    return PAPERS[name]
