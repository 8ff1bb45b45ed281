"""Cost against time: what each policy reaches in which time per step, and which of them nobody beats in both.

>>> python -m baselines.pareto --out results/pareto --write docs/pareto.md
"""
