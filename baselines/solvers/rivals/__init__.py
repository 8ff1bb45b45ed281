"""Solvers of other projects as policies: each is handed the model as a file, the limits, and a pose at each step.

Their packages are the extra `rivals`, imported when a policy is made.
"""
