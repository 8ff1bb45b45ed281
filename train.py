"""Trains agents: ``python train.py --help``."""

import sys

from baselines.training.command import main

if __name__ == "__main__":
    sys.exit(main())
