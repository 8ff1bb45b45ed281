"""Runs the notebook, and keeps what its cells show: ``python -m docs.notebook``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

FILE = Path(__file__).parent / "notebooks" / "panda.ipynb"
#: Most seconds that a cell may take.
TIMEOUT = 300


def executed(file: Path) -> Any:
    """The notebook with what its cells show in a kernel of their own."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(file, as_version=4)
    NotebookClient(notebook, timeout=TIMEOUT, kernel_name="python3", record_timing=False).execute()
    return notebook


def main() -> None:
    """Writes the notebook anew."""
    import nbformat

    nbformat.write(executed(FILE), FILE)


if __name__ == "__main__":
    main()
