"""The ledger: claims of the papers and findings of their tests, as a CSV file and as Markdown."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from baselines.papers.paper import Finding, Paper

#: Fields of the CSV file.
FIELDS = ("paper", "claim", "verdict", "figures")

Row = Mapping[str, str]


def rows(findings: Mapping[str, Mapping[str, Finding]]) -> list[Row]:
    """One row a claim.

    Args:
        findings: The results, by paper and claim.
    """
    return [
        dict(zip(FIELDS, (paper, claim, found.verdict, found.text), strict=True))
        for paper, of_paper in findings.items()
        for claim, found in of_paper.items()
    ]


def to_csv(results: Iterable[Row]) -> str:
    """The rows as the text of a CSV file."""
    out = io.StringIO()
    writer = csv.DictWriter(out, FIELDS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(results)
    return out.getvalue()


def from_csv(text: str) -> list[Row]:
    """The rows of a CSV file that :func:`to_csv` has written."""
    return list(csv.DictReader(io.StringIO(text)))


def markdown(papers: Sequence[Paper], results: Iterable[Row]) -> str:
    """The ledger as Markdown: a table for each paper.

    Args:
        papers: The papers, in order.
        results: The rows of all their claims.
    """
    by_claim = {(row["paper"], row["claim"]): row for row in results}
    parts = []
    for paper in papers:
        of_paper = [by_claim[paper.name, claim.name] for claim in paper.claims]
        counts = Counter(row["verdict"] for row in of_paper)
        parts += [
            f"## {paper.title}\n",
            f"{', '.join(f'{number} {verdict}' for verdict, number in sorted(counts.items()))}.\n",
            "| claim | test | figures | verdict |\n|---|---|---|---|",
        ]
        for claim, row in zip(paper.claims, of_paper, strict=True):
            verdict = f"*{row['verdict']}*" + (f": {claim.condition}" if claim.condition else "")
            cells = (f"{claim.text} ({claim.where})", claim.method, row["figures"], verdict)
            parts.append(f"| {' | '.join(cells)} |")
        parts.append("")
    return "\n".join(parts)
