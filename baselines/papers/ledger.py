"""The ledger: claims of the papers and findings of their tests, in rows and as Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from baselines.papers.paper import Finding, Paper

Row = Mapping[str, str]


def rows(findings: Mapping[str, Mapping[str, Finding]]) -> list[Row]:
    """One row a claim, of findings by paper and claim."""
    return [
        {"paper": paper, "claim": claim, "verdict": found.verdict, "figures": found.text}
        for paper, of_paper in findings.items()
        for claim, found in of_paper.items()
    ]


def markdown(papers: Sequence[Paper], results: Iterable[Row]) -> str:
    """The ledger as Markdown: a table for each paper, of the rows of all their claims."""
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
