"""Policies that correct their model or their reference on the way."""
