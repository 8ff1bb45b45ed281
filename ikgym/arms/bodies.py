"""Bodies of an arm: spheres and capsules fixed to its links."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.kernels.bodies import OBSTACLE, Shapes, Surroundings
from ikgym.validation import (
    LARGEST,
    SMALLEST,
    FloatArray,
    IntArray,
    different_texts,
    float_array,
    frozen_array,
    known_names,
    read_only,
    shorten,
    whole_number,
)

#: More bodies than an arm has.
MOST_BODIES = 1000


@runtime_checkable
class Neighbour(Protocol):
    """The part of an obstacle that bodies need, see :mod:`ikgym.obstacles`."""

    @property
    def ignored(self) -> Sequence[str]:
        """Names of bodies that may touch it."""

    @property
    def count(self) -> int:
        """How many rows of numbers it has."""

    def numbers(self) -> FloatArray:
        """The obstacle as a row of :class:`ikgym.kernels.bodies.Surroundings`. Shape (16,) or (count, 16)."""


@dataclasses.dataclass(frozen=True, eq=False)
class Bodies(Frozen):
    """Spheres and capsules fixed to the links of an arm, to its tool and to a held object.

    A body is all that is within its radius of the segment from its start to its end; a sphere has both in one place.
    Link 0 is the base, and link i moves with joint i. The frame of a link has its origin in the joint, behind the
    offset of :class:`ikgym.Arm`, and is parallel to the base at q = 0; that of link 0 is the base itself.

    Two bodies can meet if they are on different links that are no neighbours, and are not named as a pair that is
    ignored. Bodies of the base do not meet obstacles.

    Args:
        names: k different texts, at most 1000.
        links: Numbers of the links. Shape (k,).
        starts: One end of each body in the frame of its link, in [m]. Shape (k, 3).
        ends: The other end, in [m]; the starts if left out. Shape (k, 3).
        radii: In [m], at least 1e-12. Shape (k,).
        ignored: Pairs of names whose bodies may touch.
        unseen: Links that may have a shape, but no body around it, each with the reason. Nothing can be said
            about the clearance of an arm that has any.

    The bodies are sorted by link. Lengths are at most 1e12.

    Raises:
        InvalidInputError: A shape, a number or a name is wrong, or an ignored pair is none.
        UnknownNameError: An ignored pair names no body.
    """

    names: Sequence[str] = ()
    links: Sequence[int] = ()
    starts: FloatArray = dataclasses.field(default_factory=lambda: np.zeros((0, 3)))
    ends: FloatArray = None  # type: ignore[assignment]  # the starts
    radii: FloatArray = dataclasses.field(default_factory=lambda: np.zeros(0))
    ignored: Sequence[Sequence[str]] = ()
    unseen: Sequence[str] = ()

    def __post_init__(self) -> None:
        names = different_texts("names of bodies", self.names)
        if len(names) > MOST_BODIES:
            raise InvalidInputError(f"names of bodies: expected at most {MOST_BODIES}, got {len(names)}.")
        links = [whole_number("links of bodies", link, at_least=0) for link in _to_tuple("links", self.links)]
        starts = _points("starts of bodies", self.starts, len(names))
        ends = starts if self.ends is None else _points("ends of bodies", self.ends, len(names))
        radii = frozen_array("radii of bodies", self.radii, (len(names),), at_least=SMALLEST, at_most=LARGEST)
        if len(links) != len(names):
            raise InvalidInputError(f"links of bodies: expected {len(names)} numbers, got {len(links)}.")
        order = np.argsort(links, kind="stable")
        self._settle(
            names=tuple(names[i] for i in order),
            links=tuple(links[i] for i in order),
            starts=read_only(starts[order]),
            ends=read_only(ends[order]),
            radii=read_only(radii[order]),
            ignored=_pairs(self.ignored, names),
            unseen=tuple(different_texts("unseen links of bodies", self.unseen)),
        )

    def __len__(self) -> int:
        return len(self.names)

    def added(
        self,
        name: str,
        link: int,
        start: npt.ArrayLike,
        end: npt.ArrayLike | None = None,
        *,
        radius: float,
        ignored: Sequence[str] = (),
    ) -> Self:
        """A copy with one more body: a sphere at its start, or a capsule to its end.

        Args:
            name: Its name.
            link: Number of its link.
            start: In the frame of the link, in [m]. Shape (3,).
            end: In the frame of the link, in [m]; the start for a sphere. Shape (3,).
            radius: In [m].
            ignored: Names of bodies that it may touch.

        Raises:
            InvalidInputError: A value is wrong, or the name is taken.
            UnknownNameError: There is no body of a name.
        """
        first = frozen_array(f"start of body {name!r}", start, (3,))
        last = first if end is None else frozen_array(f"end of body {name!r}", end, (3,))
        return self.replace(
            names=(*self.names, name),
            links=(*self.links, link),
            starts=np.vstack([self.starts, first]),
            ends=np.vstack([self.ends, last]),
            radii=np.append(self.radii, radius),
            ignored=(*self.ignored, *((name, other) for other in ignored)),
        )

    def check_seen(self, arm: str) -> None:
        """Checks that each link that may have a shape has a body.

        Args:
            arm: Name of the arm in messages.

        Raises:
            InvalidInputError: A link has none; the message names it, the reason and the ways out.
        """
        if self.unseen:
            links = ", ".join(text.partition(": ")[0] for text in self.unseen)
            raise InvalidInputError(
                f"bodies of arm {arm!r}: expected one on each link, got none on {links}. {self.unseen[0]}. Name the "
                "folder of the meshes (packages, --packages DIR), add collision shapes to the file, or name the links "
                "that may touch (bodyless, --bodyless LINK …)."
            )

    def check(self, joints: int) -> None:
        """Checks that an arm with a number of joints has the links.

        Raises:
            InvalidInputError: It lacks one; the message names the body.
        """
        for name, link in zip(self.names, self.links, strict=True):
            if link > joints:
                raise InvalidInputError(
                    f"link of body {name!r}: expected a number from 0, the base, to {joints}, the last, got {link}."
                )

    @functools.cached_property
    def pairs(self) -> IntArray:
        """Numbers of the bodies that can meet: the one on the later link, then the other. Shape (p, 2)."""
        ignored = {frozenset(pair) for pair in self.ignored}
        found = [
            (first, second)
            for first in range(len(self))
            for second in range(first)
            if self.links[first] - self.links[second] > 1
            and frozenset((self.names[first], self.names[second])) not in ignored
        ]
        pairs = np.array(found, dtype=np.int64).reshape(-1, 2)
        pairs.flags.writeable = False
        return pairs

    @property
    def shapes(self) -> Shapes:
        """The bodies as kernels see them."""
        sizes = 0.5 * np.linalg.norm(self.ends - self.starts, axis=1) + self.radii
        links = np.array(self.links, dtype=np.int64)
        return Shapes(links, self.starts.copy(), self.ends.copy(), self.radii.copy(), sizes, self.pairs.copy())

    def surroundings(self, obstacles: Sequence[Neighbour]) -> Surroundings:
        """Obstacles as kernels see them, moving ones at their initial place.

        Args:
            obstacles: The obstacles.

        Raises:
            InvalidInputError: An obstacle is none.
            UnknownNameError: An obstacle ignores a body that there is not.
        """
        if not isinstance(obstacles, (tuple, list)) or not all(isinstance(one, Neighbour) for one in obstacles):
            raise InvalidInputError(f"obstacles: expected a list of obstacles, got {shorten(obstacles)}.")
        rows = [np.reshape(one.numbers(), (-1, OBSTACLE)) for one in obstacles]
        boxes, checked = np.concatenate([np.empty((0, OBSTACLE)), *rows]), []
        for one in obstacles:
            known_names("body", one.ignored, self.names)
            meets = [link > 0 and name not in one.ignored for name, link in zip(self.names, self.links, strict=True)]
            checked += [meets] * one.count
        return Surroundings(boxes, np.array(checked, dtype=np.bool_).reshape(len(boxes), len(self)))


def _points(name: str, given: npt.ArrayLike, count: int) -> FloatArray:
    points = float_array(name, given, at_most=LARGEST)
    return frozen_array(name, points if points.size else np.zeros((0, 3)), (count, 3))


def _pairs(given: Any, names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    pairs = []
    for pair in _to_tuple("ignored pairs", given):
        if not isinstance(pair, (tuple, list)) or len(pair) != 2 or not all(isinstance(one, str) for one in pair):
            raise InvalidInputError(f"ignored pairs of bodies: expected two names each, got {shorten(pair)}.")
        known_names("body", pair, names)
        pairs.append((pair[0], pair[1]))
    return tuple(pairs)


def _to_tuple(name: str, given: Any) -> tuple[Any, ...]:
    if not isinstance(given, (tuple, list, np.ndarray)):
        raise InvalidInputError(f"{name} of bodies: expected a list, got {shorten(given)}.")
    return tuple(given)
