"""Training of agents with memory: random plants, measurements on them, and the filter in PyTorch."""
