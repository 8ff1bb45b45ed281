"""Receding horizons: the cost of the steps ahead minimised at each step (Varga 2021)."""
