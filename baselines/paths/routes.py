"""Joint paths along a whole reference, by dynamic programming over the inverse kinematics of its poses."""

from __future__ import annotations

import dataclasses
import functools
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from tqdm import tqdm

from baselines.paths.starts import solutions
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.bodies import clearance_rows
from ikgym.obstacles.solids import solids_of
from ikgym.scenarios import Scenario
from ikgym.validation import BoolArray, FloatArray, float_array, per_joint

#: Joint motions aside from the task, as shares of the largest ones that are allowed, and how many random directions
#: they have in null spaces of several dimensions.
ASIDE, DIRECTIONS = np.linspace(-0.98, 0.98, 5), 3
#: To first order a motion may be this multiple of the largest one: waypoints can be 10° apart. If it is still too large
#: when the pose is met, it is corrected along the null space, this number of times.
FIRST_ORDER, CORRECTIONS = 1.3, 2
#: Share of the largest motion that is used, and distance in [m] and angle in [rad] within which a pose is met.
USED, TOLERANCE = 0.999, 1e-9
#: Between two knots bodies are checked at these parts of the way, which are even.
PARTS = (0.25, 0.5, 0.75, 1.0)
#: Components of the errors of tasks for which there is a search.
SEARCHED = (3, 5, 6)
#: Postures are left out whose Jacobian, in units of the largest motions, has less than this on a diagonal.
SINGULAR = 1e-6


class Layer(NamedTuple):
    """Postures at one knot.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (k, n).
        cost: Sum of the squared motions up to here, in units of the largest ones. Shape (k,).
        before: The posture of the knot before that each is reached from. Shape (k,).
    """

    q: FloatArray
    cost: FloatArray
    before: npt.NDArray[np.int64]

    def of(self, chosen: BoolArray | npt.NDArray[np.int64]) -> Layer:
        """Some of the postures."""
        return Layer(self.q[chosen], self.cost[chosen], self.before[chosen])


@dataclasses.dataclass(frozen=True, eq=False)
class Routes:
    """Searches the joint path with the least motion through the poses of a path, clear of all bodies.

    From each posture at a knot the next pose is reached by several joint motions, which differ in the null space of the
    Jacobian. Those within the limits, clear by the margin and no larger than allowed are kept, one for each cell of the
    joint space: the one with the least sum of squared motions so far. This is forward dynamic programming, as for
    redundancy resolution on grids (Pashkevich, Dolgui and Chumakov 2004; Ferrentino and Chiacchio 2020), with postures
    that lie on the path exactly. A path that is not found may exist between the cells.

    Args:
        scenario: A scenario whose path is the same at every reset, and whose task is a position, an axis, or a pose.
        times: Of the knots in [s]. Shape (k,).
        largest: Largest motion of each joint between two knots, in [rad] or [m]. Shape (n,).
        margin: Distance that bodies keep at knots and on the way between them, in [m].
        edge: Distance that joints keep from their stops, in [rad] or [m].
        cell: Size of the cells, as a share of the largest motion.
        postures: Most postures that are kept at a knot.

    Raises:
        InvalidInputError: The scenario is random or its task another one, or a number is wrong.
    """

    scenario: Scenario
    times: FloatArray
    largest: FloatArray
    margin: float = 0.002
    edge: float = 0.0
    cell: float = 0.6
    postures: int = 800

    def __post_init__(self) -> None:
        if self.scenario.random or self.scenario.task.error_size not in SEARCHED:
            raise InvalidInputError(
                f"Scenario {self.scenario.name!r}: expected one path, and a task of a position, an axis or a pose."
            )
        object.__setattr__(self, "times", float_array("times", self.times, (None,)))
        object.__setattr__(self, "largest", per_joint("largest", self.largest, self.scenario.joints))
        if (self.largest <= 0.0).any():
            raise InvalidInputError(f"largest: expected numbers above 0, got {self.largest}.")

    def route(self, start: FloatArray | None = None) -> FloatArray:
        """Joint coordinates at the knots in [rad] or [m], as far as there is a way. Shape (r, n), r at most k.

        Args:
            start: Joint coordinates at the first knot in [rad] or [m], where they are given; else any will do.
        """
        rng = np.random.default_rng(0)
        q, arm = (solutions(self.scenario), self.arm) if start is None else (start[None], self.scenario.arm)
        layers = [Layer(q, np.zeros(len(q)), np.zeros(len(q), dtype=np.int64))]
        layers[0] = layers[0].of(self._clear(0, q) & ((arm.lower <= q) & (q <= arm.upper)).all(axis=1))
        # A search of seconds needs no bar, one of minutes does; there is none where nobody watches.
        with tqdm(total=len(self.times), desc="Planning", unit="knot", delay=3.0, disable=None, leave=False) as bar:
            while len(layers) < len(self.times) and len(layers[-1].q):
                layers.append(self._next(len(layers), layers[-1], rng))
                bar.update()
        if not len(layers[-1].q):
            layers.pop()
        row, out = int(np.argmin(layers[-1].cost)) if layers else 0, []
        for layer in reversed(layers):
            out.append(layer.q[row])
            row = int(layer.before[row])
        return np.array(out[::-1]).reshape(-1, self.scenario.joints)

    @functools.cached_property
    def arm(self) -> Arm:
        """The arm with limits that leave the edge free."""
        arm = self.scenario.arm
        return arm if self.edge == 0.0 else arm.replace(lower=arm.lower + self.edge, upper=arm.upper - self.edge)

    def meet(self, frames: FloatArray, near: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Postures at poses of the path, near others (N, n), and whether they meet them. Shapes (N, n), (N,)."""
        start = np.clip(near, self.arm.lower, self.arm.upper)
        rotations = rotations_near(self.scenario, frames, self.arm.forward(start)[0])
        return self.arm.inverse(rotations, frames[..., -3:], start=start, tolerance=TOLERANCE, restarts=0)

    def _next(self, knot: int, last: Layer, rng: np.random.Generator) -> Layer:
        """The postures at a knot that can be reached from those before."""
        moves, rows = self._moves(knot, last.q, rng)
        q, met = self.meet(self.frames[knot], last.q[rows] + self.largest * moves)
        for _ in range(CORRECTIONS * (self.scenario.joints > self.scenario.task.error_size)):
            moves = (q - last.q[rows]) / self.largest
            size = np.abs(moves).max(axis=1)
            far = np.flatnonzero(met & (size > USED) & (size <= FIRST_ORDER))
            q[far], met[far] = self.meet(self.frames[knot], q[far] + self.largest * self._back(q[far], moves[far]))
        moves = (q - last.q[rows]) / self.largest
        near = met & (np.abs(moves).max(axis=1) <= USED)
        found = Layer(q, last.cost[rows] + (moves * moves).sum(axis=1), rows).of(near)
        for part in PARTS:
            found = found.of(self._clear(knot - 1.0 + part, self._interpolate(last, found, part)))
        return found.of(self._cheapest(found.q, found.cost, rng))

    def _back(self, q: FloatArray, moves: FloatArray) -> FloatArray:
        """Joint motions in the null space at q after which moves that are too large are within 1, to first order."""
        turned, _, jacobian = self.scenario.arm.forward_and_jacobian(q)
        jacobian = self._rows(jacobian, turned) * self.largest
        direction = np.linalg.svd(jacobian).Vh[:, -1]
        middle, half = _room(moves, direction)
        half = ASIDE[-1] * np.maximum(half, 0.0)
        out: FloatArray = np.clip(0.0, middle - half, middle + half)[:, None] * direction
        return out

    def _moves(self, knot: int, q: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """Joint motions to a knot in units of the largest ones, and the rows of q where they begin; to first order."""
        turned, there, jacobian = self.scenario.arm.forward_and_jacobian(q)
        wanted = rotations_near(self.scenario, self.frames[knot], turned)
        error = np.hstack([self.frames[knot, -3:] - there, np.zeros_like(there)])
        if wanted is not None:
            error[:, 3:] = 0.5 * np.cross(turned, wanted, axis=1).sum(axis=2)
        error = self._rows(error[..., None], turned)[..., 0]
        jacobian = self._rows(jacobian, turned) * self.largest
        basis, triangle = np.linalg.qr(jacobian.transpose(0, 2, 1), mode="complete")
        rank = error.shape[1]
        triangle = triangle[:, :rank].transpose(0, 2, 1)
        solvable = np.abs(np.diagonal(triangle, axis1=1, axis2=2)).min(axis=1) > SINGULAR
        rows = np.flatnonzero(solvable)
        least = np.linalg.solve(triangle[rows], error[rows, :, None])
        least = (basis[rows, :, :rank] @ least)[..., 0]
        free = basis[rows, :, rank:]
        # An arm without a null space has one motion to each pose.
        moves, begins = ([], []) if free.shape[2] else ([least], [rows])
        for _ in range((0, 1, DIRECTIONS)[min(free.shape[2], 2)]):
            direction = (free @ rng.normal(size=(len(rows), free.shape[2], 1)))[..., 0]
            middle, half = _room(least, direction)
            for share in ASIDE:
                moves.append(least + (middle + share * half)[:, None] * direction)
                begins.append(rows)
        every = np.concatenate(moves)
        small = np.abs(every).max(axis=1) <= FIRST_ORDER
        return every[small], np.concatenate(begins)[small]

    def _rows(self, values: FloatArray, turned: FloatArray) -> FloatArray:
        """The rows of (N, 6, k) that belong to the task; about the tool's x and y axes where its z axis is free."""
        size = self.scenario.task.error_size
        if size != 5:
            return values[:, :size]
        return np.concatenate([values[:, :3], turned[:, :, :2].swapaxes(1, 2) @ values[:, 3:]], axis=1)

    @functools.cached_property
    def frames(self) -> FloatArray:
        """The poses at the knots, as :meth:`Trajectory.frames` has them. Shape (k, 12) or (k, 3)."""
        return self.scenario.trajectory.frames(self.times, self.scenario.model)

    def _interpolate(self, last: Layer, found: Layer, part: float) -> FloatArray:
        begin = last.q[found.before]
        return begin + part * (found.q - begin)

    def _wrap(self, q: FloatArray) -> FloatArray:
        """The same postures, joints without limits within a turn."""
        endless = np.isinf(self.scenario.arm.upper - self.scenario.arm.lower)
        return np.where(endless, np.remainder(q, 2.0 * np.pi), q)

    def _cheapest(self, q: FloatArray, cost: FloatArray, rng: np.random.Generator) -> npt.NDArray[np.int64]:
        """The rows of the least costs in each cell, some of them where they are too many. Shapes (N, n), (N,)."""
        order = np.argsort(cost, kind="stable")
        cells = np.floor(self._wrap(q[order]) / (self.cell * self.largest)).astype(np.int64)
        chosen: npt.NDArray[np.int64] = order[np.unique(cells, axis=0, return_index=True)[1]]
        return chosen if len(chosen) <= self.postures else rng.choice(chosen, self.postures, replace=False)

    def _clear(self, knot: float, q: FloatArray) -> BoolArray:
        """Whether bodies keep the margin when the path is at a knot, or between two."""
        scenario = self.scenario
        if not scenario.collides:
            return np.ones(len(q), dtype=np.bool_)
        boxes = self._boxes[min(round(len(PARTS) * knot), len(self._boxes) - 1)]
        distances, pairs = np.empty(len(q)), np.empty((len(q), 2), dtype=np.int64)
        arm, checked = scenario.arm, scenario.surroundings.checked
        clearance_rows(arm.chain, arm.bodies.shapes, boxes, checked, q, distances, pairs)
        return distances > self.margin

    @functools.cached_property
    def _boxes(self) -> FloatArray:
        """The obstacles at all parts of the way; once where they are at rest. Shape (p, o, 16)."""
        knots = np.arange(len(PARTS) * (len(self.times) - 1) + 1) / len(PARTS)
        times = np.interp(knots, np.arange(len(self.times)), self.times)
        return solids_of(self.scenario.obstacles, times, self.scenario.model)


def rotations_near(scenario: Scenario, frames: FloatArray, turned: FloatArray) -> FloatArray | None:
    """Rotations of the tool that a task allows at frames (..., 12), near others (N, 3, 3); None where all will do."""
    if not scenario.task.has_orientation:
        return None
    rotations = np.broadcast_to(frames[..., :9].reshape(*frames.shape[:-1], 3, 3), turned.shape)
    if scenario.task.error_size != 5:
        return rotations
    z = rotations[:, :, 2]
    x = turned[:, :, 0] - (turned[:, :, 0] * z).sum(axis=1, keepdims=True) * z
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _room(moves: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far moves can go along directions with all joints within 1: middle and half of the range. Shape (N,) each."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.sort([(-1.0 - moves) / direction, (1.0 - moves) / direction], axis=0)
    low, high = ends[0].max(axis=1), ends[1].min(axis=1)
    # A joint that moves too far, and not along the direction, leaves no range.
    finite = np.isfinite(low) & np.isfinite(high)
    low, high = (np.where(finite, end, 0.0) for end in (low, high))
    return 0.5 * (low + high), 0.5 * (high - low)
