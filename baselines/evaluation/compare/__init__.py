"""Which solver for an arm and a path: solvers are played, and one is recommended by a written rule."""
