"""Training of agents, by `ikgym train` and `train.py`; trained agents are policies of :mod:`baselines.agents`."""
