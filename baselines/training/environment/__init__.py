"""The environment as agents see it in training."""
