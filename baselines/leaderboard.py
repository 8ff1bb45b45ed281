"""The command line: ``python -m baselines.leaderboard``."""

import sys

from baselines.evaluation.pages.command import main

if __name__ == "__main__":
    sys.exit(main())
