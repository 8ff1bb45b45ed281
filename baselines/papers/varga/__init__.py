"""Varga, Issa, Horváth and Tar 2021: the receding horizon without Lagrange multipliers."""
