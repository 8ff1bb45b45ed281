"""Configurations of training runs, as validated data."""
