"""Arms from URDF files: the XML, the tree of links, the joints of a chain, the links that may be the tip."""

from ikgym.arms.urdf.chain import Tip
from ikgym.arms.urdf.reading import MAX_BYTES, from_urdf, open_meshes, tips

__all__ = ["MAX_BYTES", "Tip", "from_urdf", "open_meshes", "tips"]
