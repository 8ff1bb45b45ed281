"""The joint motion of an episode, as it was played and as messages that a controller accepts."""
