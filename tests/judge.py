"""Distances of bodies by coal, with link frames by NumPy: a judge that knows none of our kernels."""

import functools

import coal
import numpy as np

from ikgym.obstacles.solids import link_frames, on_links

#: Pairs farther apart than this are left out, in [m].
FAR = 0.02


class Judge:
    """The smallest distances of an arm's bodies from obstacles and each other, 0 or less where they overlap.

    Args:
        scenario: A scenario with bodies.
    """

    def __init__(self, scenario):
        self.arm, bodies = scenario.arm, scenario.arm.bodies
        self.solids, self.links = on_links(bodies), np.array(bodies.links)
        met = np.argwhere(scenario.surroundings.checked)[:, ::-1] + [0, len(bodies)]
        self.pairs = np.vstack([bodies.pairs.reshape(-1, 2), met])
        self.request, self.result = coal.DistanceRequest(), coal.DistanceResult()

    def __call__(self, q, obstacles):
        """In [m], at most :data:`FAR`. Shapes (k, n), (k or 1, o, 16) and (k,)."""
        solids = np.concatenate([self.placed(q), np.broadcast_to(obstacles, (len(q), *obstacles.shape[1:]))], axis=1)
        centres, radii = solids[..., 9:12], np.linalg.norm(solids[..., 12:15], axis=2) + solids[..., 15]
        radii[solids[..., 12] < 0.0] = np.inf  # half-spaces
        first, second = self.pairs.T
        apart = np.linalg.norm(centres[:, first] - centres[:, second], axis=2) - radii[:, first] - radii[:, second]
        out = np.full(len(q), FAR)
        for row, pair in np.argwhere(apart < FAR):
            out[row] = min(out[row], self.distance(*solids[row, self.pairs[pair]]))
        return out

    def placed(self, q):
        """The bodies as solids. Shape (k, b, 16)."""
        frames = link_frames(self.arm, q)[:, self.links]
        rotations = frames[..., :9].reshape(*frames.shape[:2], 3, 3)
        out = np.tile(self.solids, (len(q), 1, 1))
        out[..., :9] = (rotations @ self.solids[:, :9].reshape(-1, 3, 3)).reshape(*frames.shape[:2], 9)
        out[..., 9:12] = frames[..., 9:] + np.einsum("kbij,bj->kbi", rotations, self.solids[:, 9:12])
        return out

    def distance(self, one, other):
        """Of two solids, in [m]."""
        (first, at), (second, there) = _shape(one), _shape(other)
        self.result.clear()
        return coal.distance(first, at, second, there, self.request, self.result)


def _shape(solid):
    return _of_size(*solid[12:].tolist()), coal.Transform3s(solid[:9].reshape(3, 3), solid[9:12])


@functools.lru_cache(1000)
def _of_size(x, y, z, radius):
    if x < 0.0:
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    return coal.Box(2 * x, 2 * y, 2 * z) if x > 0.0 else coal.Capsule(radius, 2 * z)
