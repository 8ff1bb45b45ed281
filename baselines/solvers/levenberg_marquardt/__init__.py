"""Levenberg–Marquardt as model-free adaptive control, and predictive (Zhang 2020)."""
