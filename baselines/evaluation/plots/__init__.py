"""Plots by matplotlib without pyplot, and so without a window system."""
