"""Joint velocities within limits: an optimisation at each step, or a saturation of one joint after the other."""
