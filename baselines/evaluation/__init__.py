"""Evaluation: test sets, episodes, metrics, results, tables, plots and pages."""
