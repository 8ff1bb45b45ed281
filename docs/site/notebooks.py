"""Notebooks as pages, with what their cells showed when they were last run."""

from __future__ import annotations

from pathlib import Path

from nbconvert import MarkdownExporter


def pages(folder: Path) -> dict[str, str | bytes]:
    """Pages and pictures by their paths on the site."""
    found: dict[str, str | bytes] = {}
    for file in sorted(folder.glob("notebooks/*.ipynb")):
        text, resources = MarkdownExporter().from_filename(str(file), resources={"unique_key": file.stem})
        found[f"notebooks/{file.stem}.md"] = text
        found |= {f"notebooks/{name}": picture for name, picture in resources["outputs"].items()}
    return found
