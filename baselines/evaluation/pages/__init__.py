"""The pages in docs/ that are measured: one table model, one measuring loop, and a page for each question.

>>> python -m baselines.leaderboard --out results/pages --agents NAME=DIR --write docs
"""
