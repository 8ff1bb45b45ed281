"""The nominal frames of N episodes."""
