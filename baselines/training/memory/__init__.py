"""Training of agents with memory: plants that are drawn, what their sensors show, and the filter in PyTorch."""
