"""Training of agents: what `train.py` runs. The agents themselves, once trained, live in :mod:`baselines.agents`."""
