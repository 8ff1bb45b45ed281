"""The command line: ``python -m baselines.pareto``."""

import sys

from baselines.evaluation.pareto.__main__ import main

if __name__ == "__main__":
    sys.exit(main())
