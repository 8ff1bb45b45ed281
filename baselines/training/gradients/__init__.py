"""Gradients of costs through the arm: compiled segments of some steps and their hand-written adjoints."""
