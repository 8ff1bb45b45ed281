"""What a training run is, as validated data."""
