"""Learned agents as policies: their features, networks and files, without a learning library."""
