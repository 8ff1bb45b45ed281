"""The ledger of claims in the documentation: ``python -m docs.paper_pages results/papers`` copies a reproduction.

Pictures and the CSV file that ``ikgym reproduce`` has written there come into this folder; ``python -m docs.tables``
then writes the tables of the page.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

import PIL.Image

from baselines.files import write
from baselines.papers import PAPERS, ledger
from docs.keeping import PAGES, RESULTS, lines

IMAGES = PAGES / "images" / "papers"
COLOURS = 32


def claims() -> str:
    """The tables of all claims, in Markdown."""
    return ledger.markdown(list(PAPERS.values()), lines("papers"))


def main() -> None:
    """Copies the pictures, with few colours, and the results."""
    source = Path(sys.argv[1])
    for paper in PAPERS.values():
        for figure in paper.figures:
            picture, out = source / paper.name / f"figure-{figure.number:02d}.png", io.BytesIO()
            PIL.Image.open(picture).convert("RGB").quantize(COLOURS).save(out, format="png", optimize=True)
            write(IMAGES / f"{paper.name}-{figure.number:02d}.png", out.getvalue())
    write(RESULTS / "papers.csv", (source / "claims.csv").read_bytes())


if __name__ == "__main__":
    main()
