"""Regenerates the papers' experiments as figures and numbers, and the ledger of their claims.

>>> from baselines.cli.commands.reproduce import reproduce
>>> findings = reproduce(["zhang"])
"""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
import sys
from collections.abc import Iterable, Mapping
from typing import Annotated

import tyro

from baselines.cli import shell
from baselines.evaluation.metrics import describe
from baselines.evaluation.plots.style import png
from baselines.evaluation.table import to_csv
from baselines.files import jsonable, locked, write, write_json
from baselines.papers import PAPERS, get, ledger
from baselines.papers.paper import Finding, Paper
from baselines.papers.runs import Runs
from ikgym.exceptions import InvalidInputError
from ikgym.validation import whole_number

#: The results of testing claims, by paper and claim.
Findings = dict[str, dict[str, Finding]]


def reproduce(
    papers: Iterable[str] = tuple(PAPERS),
    *,
    figures: Iterable[int] | None = None,
    out: pathlib.Path | str | None = None,
    steps: int | None = None,
    progress: bool = False,
) -> Findings:
    """Plays the experiments of papers, draws their figures and tests their claims.

    Args:
        papers: Names of papers.
        figures: Numbers of the figures to draw. If left out, all are drawn, and the claims are tested.
        out: Folder for ``PAPER/figure-NN.png``, ``PAPER/numbers.json``, ``claims.csv`` and ``papers.md``; no files if
            left out.
        steps: Most steps of an episode, for trials, whose findings mean nothing.
        progress: Whether to show bars and the files written on stderr.

    Returns:
        The findings, by paper and claim.

    Raises:
        UnknownNameError: There is no such paper.
        InvalidInputError: A paper has no such figure.
        ResultsError: `out` cannot be written.
    """
    if steps is not None:
        whole_number("steps", steps, at_least=1)
    chosen = [get(name) for name in papers]
    numbers = None if figures is None else set(figures)
    for paper in chosen:
        there = [figure.number for figure in paper.figures]
        if missing := (numbers or set()) - set(there):
            raise InvalidInputError(f"figure: paper {paper.name!r} has no figure {min(missing)}; it has {there}.")
    folder, runs = None if out is None else pathlib.Path(out), Runs(steps, progress=progress)
    findings: Findings = {}
    with contextlib.nullcontext() if folder is None else locked(folder):
        for paper in chosen:
            _draw(paper, runs, numbers, folder, progress=progress)
            findings[paper.name] = {} if numbers is not None else {c.name: c.test(runs) for c in paper.claims}
            if folder is not None and numbers is None:
                _write_numbers(folder / paper.name / "numbers.json", findings[paper.name])
        if folder is not None and numbers is None:
            results = ledger.rows(findings)
            write(folder / "claims.csv", to_csv(results).encode())
            write(folder / "papers.md", ledger.markdown(chosen, results).encode())
    return findings


def _draw(paper: Paper, runs: Runs, numbers: set[int] | None, folder: pathlib.Path | None, *, progress: bool) -> None:
    for figure in paper.figures:
        if numbers is None or figure.number in numbers:
            picture = figure.draw(runs)
            if folder is not None:
                file = folder / paper.name / f"figure-{figure.number:02d}.png"
                write(file, png(picture))
                if progress:
                    print(f"{file}: {figure.title}", file=sys.stderr)


def _write_numbers(file: pathlib.Path, findings: Mapping[str, Finding]) -> None:
    claims = {
        name: {"verdict": found.verdict, "holds": found.holds, "figures": found.figures}
        for name, found in findings.items()
    }
    write_json(file, jsonable({"machine": describe(), "claims": claims}))


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the command."""

    paper: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = tuple(PAPERS)
    """Papers: varga, faitli, khan, zhang."""
    figure: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = ()
    """Figures to draw, by their numbers in the paper. If left out, all are drawn, and the claims are tested."""
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")] = pathlib.Path("results/papers")
    """Folder for the files."""
    steps: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Most steps of an episode, for trials, whose findings mean nothing."""


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Regenerates the experiments of the papers: draws every figure again and tests every claim.

Examples:
  {prog}
  {prog} --paper khan --figure 3 4

Files in the folder of --out:
  PAPER/figure-NN.png  a figure of the paper, with its number there
  PAPER/numbers.json   the numbers behind the claims
  claims.csv           claim by claim, the verdict and the figures
  papers.md            the same as tables, with how each claim was tested"""


def _work(options: Options, _: str) -> None:
    findings = reproduce(
        options.paper, figures=options.figure or None, out=options.out, steps=options.steps, progress=True
    )
    for row in ledger.rows(findings):
        print(f"{row['paper']:8} {row['verdict']:13} {row['claim']}: {row['figures']}")
    print(f"\nwritten to {options.out}")


main = shell.Command("reproduce", Options, manual, _work)
