"""The bilinear actor: joint velocities linear in the twist that is due, by a matrix that a network chooses."""
