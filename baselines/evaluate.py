"""Evaluates policies on scenarios: costs, errors, joint velocities and times, as a table, as files and as plots.

>>> from baselines.evaluate import evaluate
>>> rows = evaluate("varga7-fast", ["dls", ("rhc_gradient", {"horizon": 5})])
>>> rows.skipped
()

The same on the command line: ``python -m baselines.evaluate --help``.
"""

from __future__ import annotations

from baselines.evaluation.run import evaluate

__all__ = ["evaluate"]

if __name__ == "__main__":
    from baselines.cli.commands.evaluate import main

    raise SystemExit(main())
