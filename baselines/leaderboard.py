"""The command line: ``python -m baselines.leaderboard``."""

import sys

from baselines.evaluation.leaderboard.__main__ import main

if __name__ == "__main__":
    sys.exit(main())
