"""The obstacles around the arm of a scenario, as kernels and messages need them."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from gymnasium.utils import seeding

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.bodies import Surroundings
from ikgym.obstacles import Obstacle, random_boxes
from ikgym.obstacles.solids import solids_of
from ikgym.plant import Plant
from ikgym.plant.draw import episode_key
from ikgym.scenarios.reference import Reference
from ikgym.trajectories import Trajectory
from ikgym.validation import FloatArray


class Surrounded(Reference):
    """Base of :class:`ikgym.Scenario`: the obstacles of an episode."""

    arm: Arm
    plant: Plant
    obstacles: Sequence[Obstacle]
    collisions: bool | None

    @property
    def collides(self) -> bool:
        """Whether an arm that touches something is stopped."""
        return bool(self.obstacles) if self.collisions is None else self.collisions

    @functools.cached_property
    def surroundings(self) -> Surroundings:
        """The obstacles as kernels see them: as they are at the start, and which bodies they are checked against."""
        boxes, checked = self.arm.bodies.surroundings(self.obstacles)
        return Surroundings(np.ascontiguousarray(self.obstacle_rows(1)[0]).reshape(boxes.shape), checked)

    @functools.cached_property
    def obstacles_shown(self) -> bool:
        """Whether the observation shows the obstacles: where one moves or is drawn."""
        return self.collides and any(one.motion is not None or one.random for one in self.obstacles)

    def obstacle_rows(self, steps: int) -> FloatArray:
        """The obstacles after 0, 1, … steps, see :class:`ikgym.kernels.bodies.Surroundings`.

        Args:
            steps: k, the number of rows.

        Returns:
            Shape (k, o, 16), or (1, o, 16) where none moves.
        """
        return solids_of(self.obstacles, self.times(steps), self.model)

    def obstacle_bounds(self) -> tuple[FloatArray, FloatArray]:
        """The smallest and the largest numbers that obstacles have in any episode. Shapes (o, 16)."""
        rows = self.obstacle_rows(self.steps + 2)
        return random_boxes.bounds(self.obstacles, rows.min(axis=0), rows.max(axis=0))

    @property
    def draws_obstacles(self) -> bool:
        """Whether obstacles are drawn when an episode begins."""
        return any(one.random for one in self.obstacles)

    def drawn_obstacles(self, episodes: Sequence[Trajectory], generators: Sequence[np.random.Generator]) -> FloatArray:
        """The obstacles at the start of several episodes, those among them that are drawn.

        Args:
            episodes: Trajectories of the k episodes.
            generators: One an episode, which has drawn its trajectory and its plant; touched only where an obstacle is
                drawn.

        Returns:
            Shape (k, o, 16).

        Raises:
            InvalidInputError: There is no room for an obstacle in an episode.
        """
        return random_boxes.drawn_rows(
            self.arm, self.obstacles, self.obstacle_rows(1)[0], episodes, self._step_times, generators
        )

    def obstacles_of(self, seed: int | None = None) -> tuple[Obstacle, ...]:
        """The obstacles of an episode, with the boxes that were drawn.

        Args:
            seed: The reset seed; needed where an obstacle is drawn.

        Raises:
            InvalidInputError: There is no seed where one is needed, or no room for an obstacle.
        """
        if not self.draws_obstacles:
            return tuple(self.obstacles)
        if seed is None:
            raise InvalidInputError(f"Scenario {self.name!r} draws obstacles: a seed says which episode is meant.")
        generator = seeding.np_random(seed)[0]
        episodes = self.trajectory.samples([generator])
        episode_key(self.plant, generator)  # drawn before them
        return random_boxes.fixed(self.obstacles, self.drawn_obstacles(episodes, [generator])[0])

    @property
    def _step_times(self) -> FloatArray:
        """The times of the nominal points after 0, 1, … steps, in [s]. Shape (steps + 1,)."""
        return np.asarray(self.points() * self.dt)
