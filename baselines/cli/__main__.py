"""The command ``ikgym`` as ``python -m baselines.cli``."""

from baselines.cli import main

raise SystemExit(main())
