"""Solvers as policies, by family."""
