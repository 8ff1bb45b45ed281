"""Faitli and Tar 2018: inverse kinematics by a quasi-differential fixed-point transformation."""
