"""Shows arms that move: the viewer in a browser (viser), and videos (moviepy)."""
