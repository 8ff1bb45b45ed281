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
        first, second = solids[:, self.pairs[:, 0]], solids[:, self.pairs[:, 1]]
        bounds = np.maximum(_bound(first, second), _bound(second, first))
        out, order = np.full(len(q), FAR), np.argsort(bounds, axis=1)
        for row, pairs in enumerate(order):
            for pair in pairs:
                if bounds[row, pair] >= out[row]:
                    break
                out[row] = min(out[row], self.distance(first[row, pair], second[row, pair]))
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


def _bound(one, other):
    """The distance of a sphere around the other solid from the first one in [m]. Shapes (k, p, 16), (k, p)."""
    away = np.einsum("kpji,kpj->kpi", one[..., :9].reshape(*one.shape[:2], 3, 3), other[..., 9:12] - one[..., 9:12])
    beyond = np.linalg.norm(np.maximum(np.abs(away) - one[..., 12:15], 0.0), axis=2) - one[..., 15]
    radii = np.where(other[..., 12] < 0.0, np.inf, np.linalg.norm(other[..., 12:15], axis=2) + other[..., 15])
    return np.where(one[..., 12] < 0.0, away[..., 2], beyond) - radii  # half-spaces have no edges


def _shape(solid):
    return _of_size(*solid[12:].tolist()), coal.Transform3s(solid[:9].reshape(3, 3), solid[9:12])


@functools.lru_cache(1000)
def _of_size(x, y, z, radius):
    if x < 0.0:
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    return coal.Box(2 * x, 2 * y, 2 * z) if x > 0.0 else coal.Capsule(radius, 2 * z)
