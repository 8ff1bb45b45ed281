"""The ledger: what the papers claim, how it was tested, and what came out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from baselines.papers.paper import Finding, Paper

HEAD = """\
# The ledger of claims

Every claim of the four papers that can be checked, with the verdict *reproduced*, *contradicted*, *depends* or *not
testable*. *Depends* means that it holds in one reading or condition that the text allows and fails in another; the row
says which. A contradicted claim fails in all of them. It is a result: nothing here was bent to make a paper right.
Written by

```sh
python -m baselines.reproduce --ledger docs/papers.md
```

which draws the papers' figures again besides, in `results/papers`. All figures are those of that run; times are those
of single calls on the machine that it ran on.
"""


def ledger(papers: Sequence[Paper], findings: Mapping[str, Mapping[str, Finding]]) -> str:
    """The ledger as Markdown.

    Args:
        papers: The papers, in order.
        findings: What the claims came to, by paper and claim.
    """
    parts = [HEAD]
    for paper in papers:
        found = findings[paper.name]
        counts = Counter(finding.verdict for finding in found.values())
        parts += [
            f"## {paper.title}\n",
            f"{', '.join(f'{number} {verdict}' for verdict, number in sorted(counts.items()))}.\n",
            "| claim | where | how it was tested | what came out | verdict |\n|---|---|---|---|---|",
            *(
                f"| {c.text} | {c.where} | {c.how} | {_cell(found[c.name].evidence)} | *{found[c.name].verdict}* |"
                for c in paper.claims
            ),
            "\nHow ambiguous places are read:\n",
            *(f"- {reading}" for reading in paper.readings),
            "",
        ]
    return "\n".join(parts)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
