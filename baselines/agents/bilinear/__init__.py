"""The bilinear agent: joint velocities linear in the twist that is due, by a matrix from a network."""
