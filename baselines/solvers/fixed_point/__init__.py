"""Fixed-point transformations and abstract rotations (Faitli 2018, Khan 2020)."""
