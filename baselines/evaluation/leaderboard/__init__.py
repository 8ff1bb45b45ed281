"""The leaderboard: trained agents beside all solvers, on episodes that nobody was trained or tuned on.

>>> python -m baselines.leaderboard --tune baselines/data/tuned.json
>>> python -m baselines.leaderboard --out results/leaderboard --agents NAME=DIR --write docs/leaderboard.md
"""
