"""Which solver for my arm: situations, how solvers stand in them, and the page made from that."""
