"""Kernels: compiled functions of arrays and numbers, which know numpy and numba alone."""
