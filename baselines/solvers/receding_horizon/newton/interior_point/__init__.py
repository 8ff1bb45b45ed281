"""Kernels: the cheapest joint path under limits of acceleration, by a primal-dual interior point method.

Limits of acceleration couple three knots, and in a horizon that makes up for an error most of them are active: chains
of double integrators, on which multipliers of an augmented Lagrangian settle slowly. An interior point method takes
some thirty Newton steps, whatever is active.
"""
