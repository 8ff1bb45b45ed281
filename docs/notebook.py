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
    """Writes the notebook anew, without what goes to stderr: progress, and that kernels are compiled."""
    import nbformat

    notebook = executed(FILE)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if output.get("name") != "stderr"]
    nbformat.write(notebook, FILE)


if __name__ == "__main__":
    main()
