"""The command line: ``python -m baselines.robustness``."""

import sys

from baselines.evaluation.pages.robustness.command import main

if __name__ == "__main__":
    sys.exit(main())
