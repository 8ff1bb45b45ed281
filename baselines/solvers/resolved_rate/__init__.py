"""Resolved rate: the desired task velocity answered by one linear step."""
