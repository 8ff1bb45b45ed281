"""References, which have privileged information."""
