"""The page of the problems that others published: policies, and the initial trajectories that were published."""
