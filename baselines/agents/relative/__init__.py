"""Agents whose velocities are in units of what is asked for, as in the environments of :mod:`ikgym.rl`."""
