"""Policies around any other solver."""
