"""Kernels: the cheapest joint path through the knots of a time grid.

What a receding horizon plans at each step and what the oracle plans for a whole episode is the same problem: a joint
path that is piecewise linear in time. Its knots are the unknowns, its slopes the joint velocities.
"""
