"""Settings that all tests share, in force before anything that heeds them is imported."""

import os

from hypothesis import settings

os.environ["MPLBACKEND"] = "Agg"

# The first call of a kernel compiles it, so no deadline; the same examples everywhere, so no surprise in CI.
settings.register_profile("ikgym", deadline=None, derandomize=True, database=None)
settings.load_profile("ikgym")
