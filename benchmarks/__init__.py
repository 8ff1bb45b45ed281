"""Learners in the environments by id, and the yardsticks that score them."""
