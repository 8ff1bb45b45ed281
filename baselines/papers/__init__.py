"""The four papers: their figures and claims."""

from __future__ import annotations

from baselines.papers.faitli import PAPER as FAITLI
from baselines.papers.khan import PAPER as KHAN
from baselines.papers.paper import Paper
from baselines.papers.varga import PAPER as VARGA
from baselines.papers.zhang import PAPER as ZHANG
from ikgym.exceptions import UnknownNameError

PAPERS: dict[str, Paper] = {paper.name: paper for paper in (VARGA, FAITLI, KHAN, ZHANG)}


def get(name: str) -> Paper:
    """The paper of a name.

    Raises:
        UnknownNameError: There is no such paper.
    """
    if name not in PAPERS:
        raise UnknownNameError("paper", name, PAPERS)
    return PAPERS[name]
