"""Drives of an arm, identified from a log of its motion: excite, read, fit, report."""
