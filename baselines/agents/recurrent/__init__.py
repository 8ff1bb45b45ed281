"""Agents with memory: a gated recurrent network that says how far a Kalman filter trusts each measurement."""
