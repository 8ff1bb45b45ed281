"""Pictures of an episode: the arm and its paths in space, and the errors over time."""

from ikgym.rendering.renderer import Renderer

__all__ = ["Renderer"]
