"""Trains agents: ``python train.py --help``, the same as ``ikgym train --help``."""

import sys

from baselines.cli import main

if __name__ == "__main__":
    sys.exit(main(["train", *sys.argv[1:]]))
