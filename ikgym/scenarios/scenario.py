"""The scenario: everything that an environment, a solver or an oracle is built from, as one frozen object."""

from __future__ import annotations

import dataclasses
import functools
import os
from collections.abc import Iterable, Sequence
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from ikgym.arms import Arm
from ikgym.arms.limits import farthest, velocity_scale
from ikgym.cost import TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.kinematics import Chain
from ikgym.plant import DrawnPlant, Plant
from ikgym.plant.draw import Draws, arm_key, episode_key
from ikgym.preview import Preview, furthest
from ikgym.scenarios import bounds, parts, starts, writing
from ikgym.simulation import nominal_rows
from ikgym.tasks import Task
from ikgym.trajectories import Trajectory, first_joints_of, frames_of
from ikgym.validation import LARGEST, SMALLEST, FloatArray, Frozen, frozen_array, number

# A start given by `options={"q": …}` may be this far from home in each joint, in [rad] or [m].
START_RANGE = 2.0 * np.pi


@dataclasses.dataclass(frozen=True, eq=False)
class Scenario(Frozen):
    """A tracking problem: arm, nominal trajectory, task coordinates, cost and time.

    Args:
        name: What the scenario is called.
        arm: The arm that moves, within its limits, and is measured, as far as the plant does not change it.
        task: The task coordinates.
        trajectory: The nominal trajectory. X^N(k) is where it stands at the time k Δt.
        velocity_limit: The joint velocity that an action of 1 means, in [rad/s] or [m/s]. A number, or one a
            joint. The arm's own velocity limits if it is left out, where all of them are finite.
        cost: The stage cost. The worst episode costs at most 1e150.
        dt: Δt in [s].
        steps: Steps of an episode, 100,000,000 at most.
        model: The arm that solvers know, and through which nominal joint paths are mapped; the arm itself if it
            is left out.
        start: Joint coordinates at the start in [rad] or [m], within the limits of the arm. If left out, the nominal
            or published ones, or for other Cartesian trajectories those at which :meth:`Arm.inverse` finds the first
            pose. Shape (n,).
        initial_pose: What is measured at the start, where it is not the arm's pose. Shape (m,).
        iterations_per_point: Steps for which the nominal point 1, 2, … is held; the last number goes on. Errors
            and costs of a point count at its last step.
        plant: What of the arm that moves, its drives and its sensors differs from the data sheet; nothing by default.
        source: Where the scenario comes from.

    Lengths, angles and velocities are at most 1e12; Δt and velocity limits are at least 1e-12, too.

    Raises:
        InvalidInputError: A value is out of its range, or arm, task and trajectory do not fit together.
    """

    name: str
    arm: Arm
    task: Task
    trajectory: Trajectory
    velocity_limit: FloatArray = None  # type: ignore[assignment]  # that of the arm
    cost: TrackingCost = dataclasses.field(default_factory=TrackingCost)
    dt: float = 1e-3
    steps: int = 1000
    model: Arm = None  # type: ignore[assignment]  # the arm itself
    start: FloatArray | None = None
    initial_pose: FloatArray | None = None
    iterations_per_point: int | tuple[int, ...] = (1,)
    plant: Plant = dataclasses.field(default_factory=Plant)
    source: str = ""

    def __new__(cls, *_: Any, **fields: Any) -> Self:
        """Refuses a field that there once was, before Python does so with less to say."""
        parts.refuse_disturbance(fields)
        return super().__new__(cls)

    def __post_init__(self) -> None:
        def settle(field: str, value: object) -> None:
            object.__setattr__(self, field, value)

        parts.check_kinds(self._fields())
        n = self.arm.joints
        settle("model", self.arm if self.model is None else self.model)
        parts.check_model(self.name, self.model, n)
        self.trajectory.check(self.model)
        parts.check_orientation(self.name, self.task, self.trajectory)
        settle("velocity_limit", velocity_scale(self.arm, self.velocity_limit))
        settle("dt", number("dt", self.dt, at_least=SMALLEST, at_most=LARGEST))
        settle("steps", bounds.step_count("steps", self.steps, n))
        if self.start is not None:
            settle("start", frozen_array("start", self.start, (n,), at_most=LARGEST))
        elif self.random and not self.starts_nominally:
            raise InvalidInputError(f"Scenario {self.name!r}: a random Cartesian trajectory needs a start.")
        if self.initial_pose is not None:
            settle("initial_pose", frozen_array("initial_pose", self.initial_pose, (self.task.size,), at_most=LARGEST))
        held = self._held()
        if not held:
            raise InvalidInputError("iterations_per_point: expected at least one number, got none.")
        held = tuple(bounds.step_count("iterations_per_point", number_of_steps, n) for number_of_steps in held)
        settle("iterations_per_point", held)
        self.plant.check(self.arm, self.steps)
        if not self.starts_nominally or (self.arm.limited and not self.random):
            self.first_q(self.trajectory)  # says whether the arm can be there
        bounds.check_cost(self.name, self.largest_step_cost(), self.steps)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one.

        A new arm is its own model if none is given. An action of 1 means the new arm's velocity limits, if it meant the
        old one's and the new one has them in all joints.

        Raises:
            UnknownNameError: There is no field of that name.
            InvalidInputError: A new value is refused.
        """
        parts.refuse_disturbance(changes)
        if "arm" in changes and self.model is self.arm:
            changes.setdefault("model", None)
        arm = changes.get("arm")
        own_scale = np.array_equal(self.velocity_limit, self.arm.velocity_limit)
        if own_scale and isinstance(arm, Arm) and np.isfinite(arm.velocity_limit).all():
            changes.setdefault("velocity_limit", None)
        return super().replace(**changes)

    def save(self, file: str | os.PathLike[str]) -> None:
        """Writes the scenario to a TOML file, which :func:`ikgym.scenarios.load` reads; every number stays exact.

        An arm of this package is written as its name, one from a URDF file as a reference to that file, relative to
        the new one, and any other in numbers.

        Args:
            file: A name that ends in ``.toml``. A file that is there already is replaced.

        Raises:
            InvalidInputError: The scenario has a part that no file can hold, such as a trajectory of your own class,
                or the file cannot be written. No file has changed then.
        """
        if type(self) is not Scenario:
            raise InvalidInputError(f"save: expected a Scenario itself, got a {type(self).__name__}.")
        writing.save(self._fields(), file)

    @property
    def joints(self) -> int:
        """The number of joints, n."""
        return self.arm.joints

    @property
    def random(self) -> bool:
        """Whether the reset seed chooses the trajectory."""
        return self.trajectory.random

    def nominal(self, seed: int | None = None, preview: Preview = 0) -> FloatArray:
        """The nominal task coordinates X^N(0), X^N(1), … of an episode, one row a step.

        Args:
            seed: The reset seed; needed where the scenario is random.
            preview: How far past the end of the episode to go on, as in the environment.

        Returns:
            Task coordinates. Shape (steps + preview + 1, m).

        Raises:
            InvalidInputError: The scenario is random and there is no seed.
        """
        points = self.points(preview)
        out = np.empty((points[-1] + 1, self.task.size))
        nominal_rows(self.task.kind, self.frames(self.episode(seed), len(out)), out)
        return out[points]

    def nominal_joint_path(self, seed: int | None = None, preview: Preview = 0) -> FloatArray | None:
        """The nominal joint coordinates of an episode, one row a step; None for a Cartesian trajectory.

        Args:
            seed: The reset seed; needed where the scenario is random.
            preview: How far past the end of the episode to go on.

        Returns:
            Joint coordinates in [rad] or [m]. Shape (steps + preview + 1, n).

        Raises:
            InvalidInputError: The scenario is random and there is no seed.
        """
        points = self.points(preview)
        path = self.episode(seed).joint_path(self.times(int(points[-1]) + 1))
        return None if path is None else path[points]

    def episode(self, seed: int | None = None) -> Trajectory:
        """The reference trajectory of an episode.

        Args:
            seed: The reset seed; needed where the scenario is random.

        Raises:
            InvalidInputError: The scenario is random and there is no seed.
        """
        if self.random and seed is None:
            raise InvalidInputError(f"Scenario {self.name!r} is random: a seed says which episode is meant.")
        return self.trajectory.sample(seeding.np_random(seed)[0]) if self.random else self.trajectory

    def drawn_plant(self, seed: int | None = None, arm_seed: int | None = None) -> DrawnPlant:
        """The plant of an episode: privileged information, for the simulation and for references alone.

        Args:
            seed: The reset seed; needed where the plant draws its arm or its drives.
            arm_seed: The seed of an arm that is kept, as the reset option has it.

        Raises:
            InvalidInputError: The plant draws something and there is no seed, or nothing that a seed of the arm keeps.
        """
        key = 0
        if arm_seed is not None:
            self.plant.check_draws_arm(self.name)
            key = arm_key(arm_seed)
        elif self.plant.draws_arm:
            if seed is None:
                raise InvalidInputError(f"Scenario {self.name!r} draws its plant: a seed says which episode is meant.")
            generator = seeding.np_random(seed)[0]
            self.trajectory.samples([generator])  # drawn before it
            key = episode_key(self.plant, generator)
        return Draws(self.plant, self.arm).one(key)

    def points(self, preview: Preview = 0) -> npt.NDArray[np.int64]:
        """Which nominal point is the target after k steps.

        Args:
            preview: How far past the end of the episode to go on.

        Returns:
            Numbers of points. Shape (steps + preview + 1,).

        Raises:
            InvalidInputError: There is no memory for so many.
        """
        last = self.steps + furthest(preview)
        bounds.afford_points(last + 1, self.joints)
        # What is held for longer than the episode is held to its end.
        *first, usual = (min(held, last + 1) for held in self._held())
        ends = np.cumsum(first, dtype=np.int64)
        rest = (last - (int(ends[-1]) if len(ends) else 0)) // usual + 1
        lengths = np.concatenate([np.array(first, dtype=np.int64), np.full(max(rest, 0), usual)])
        return np.concatenate([[0], np.repeat(np.arange(1, len(lengths) + 1), lengths)])[: last + 1]

    def counted(self) -> npt.NDArray[np.bool_]:
        """Whether errors and costs count after k steps: at the last step of each point, and of the episode.

        Returns:
            Truth values; the start does not count. Shape (steps + 1,).
        """
        points = self.points(1)
        out: npt.NDArray[np.bool_] = points[1:] != points[:-1]
        out[0], out[-1] = False, True
        return out

    def frames(self, trajectory: Trajectory, points: int) -> FloatArray:
        """The nominal frames of one episode, one row a point; see :meth:`Trajectory.frames`.

        Args:
            trajectory: What was drawn for the episode.
            points: How many points.

        Returns:
            Frames. Shape (points, 12), or (points, 3) where the task has no orientation.
        """
        frames = trajectory.frames(self.times(points), self.model)
        return np.ascontiguousarray(frames if self.task.has_orientation else frames[:, -3:])

    def frames_of(self, episodes: Sequence[Trajectory], points: npt.NDArray[np.int64]) -> FloatArray:
        """The nominal frames of several episodes, each at points of its own; bit for bit those of :meth:`frames`.

        Args:
            episodes: What was drawn for the k episodes.
            points: Numbers of points. Shape (k, p).

        Returns:
            Frames. Shape (k, p, 12), or (k, p, 3) where the task has no orientation.
        """
        frames = frames_of(episodes, points.astype(np.float64) * self.dt, self.model)
        return frames if self.task.has_orientation else frames[..., -3:]

    def times(self, points: int) -> FloatArray:
        """When the trajectory is at its nominal points, in [s]. Shape (points,)."""
        return np.arange(points, dtype=np.float64) * self.dt

    def first_q(self, trajectory: Trajectory) -> FloatArray:
        """Where the arm of the data sheet begins an episode, in [rad] or [m]. Shape (n,).

        Args:
            trajectory: What was drawn for the episode.

        Raises:
            InvalidInputError: The arm cannot be there; the message names the joint.
        """
        start: FloatArray = self.first_q_of([trajectory])[0]
        return start

    def start_of(self, seed: int | None = None, arm_seed: int | None = None) -> FloatArray:
        """The joint coordinates at the start of an episode in [rad] or [m], those of the arm that moves. Shape (n,).

        Args:
            seed: The reset seed; needed where the scenario is random, or its plant draws an arm.
            arm_seed: The seed of an arm that is kept, as the reset option has it.

        Raises:
            InvalidInputError: There is no seed where one is needed, or the arm cannot be there.
        """
        q = self.first_q(self.episode(seed))
        if not self.jogs:
            return q
        start: FloatArray = self.jogged(q[None], [self.drawn_plant(seed, arm_seed).arm.chain])[0]
        return start

    @property
    def jogs(self) -> bool:
        """Whether episodes begin where the arm that moves, not that of the data sheet, has the first pose."""
        return self.start is None and self.plant.other_arm

    def jogged(self, q: FloatArray, chains: Iterable[Chain]) -> FloatArray:
        """Starts of arms that are not that of the data sheet: each where it has the pose that this would begin with.

        Args:
            q: Starts of the arm of the data sheet in [rad] or [m]. Shape (k, n).
            chains: The k arms that move.

        Returns:
            Joint coordinates in [rad] or [m], as near to the poses as the arms get within the limits. Shape (k, n).
        """
        from ikgym.arms.inverse import alike  # its kernels take longer to load than all arms

        return alike(self.arm, chains, q, oriented=self.task.has_orientation)

    def first_q_of(self, episodes: Sequence[Trajectory]) -> FloatArray:
        """Where the arm of the data sheet begins several episodes, as :meth:`first_q` gives it. Shape (k, n).

        Args:
            episodes: What was drawn for the k episodes.

        Raises:
            InvalidInputError: The arm cannot be at one of them; the message names the joint.
        """
        first = first_joints_of(episodes) if self.starts_nominally else None
        if first is None:
            first = np.tile(self._start, (len(episodes), 1))
        if self.arm.limited:
            self.arm.check_posture(f"Start of scenario {self.name!r}", first)
        return first

    def joint_bound(self) -> FloatArray:
        """Absolute joint coordinates that no arm exceeds in an episode, in [rad] or [m]. Shape (n,)."""
        added: FloatArray = np.abs(self.plant.bias) + np.abs(self.plant.noise)
        travelled = self.start_bound() + self.steps * self.dt * (self.velocity_limit + added)
        return np.minimum(travelled, farthest(self.arm))

    @property
    def largest_qdot(self) -> FloatArray:
        """The largest joint velocities that actions and the arm allow, in [rad/s] or [m/s]. Shape (n,)."""
        return np.minimum(self.velocity_limit, self.arm.velocity_limit)

    def largest_step_cost(self) -> float:
        """The most that one step of any episode can cost."""
        trajectory = self.trajectory
        if trajectory.random and trajectory.joint_bound() is None and type(trajectory).reach is Trajectory.reach:
            nominal = LARGEST  # a distribution that does not say how far its paths go
        else:
            nominal = trajectory.reach(self.times(int(self.points()[-1]) + 1), self.model)
        distance = self.plant.reach(self.arm, self.joint_bound()) + nominal
        return bounds.largest_step_cost(self.task, self.cost, self.velocity_limit, distance)

    def start_bound(self) -> FloatArray:
        """Absolute joint coordinates that no start exceeds, in [rad] or [m]. Shape (n,)."""
        known = self.trajectory.first_joints_bound() if self.starts_nominally else np.abs(self._start)
        usual = np.full(self.joints, START_RANGE)
        reachable = np.maximum(usual, 0.0 if known is None else known)
        within = farthest(self.arm)
        return np.where(np.isfinite(within), within, reachable)

    @property
    def starts_nominally(self) -> bool:
        """Whether the trajectory says where episodes begin: on its joint path, or at a published start."""
        return self.start is None and self.trajectory.first_joints_bound() is not None

    @functools.cached_property
    def _start(self) -> FloatArray:
        """The start of all episodes: the one that is given, or one at the first pose of a Cartesian trajectory."""
        if self.start is not None:
            return self.start
        return starts.found(self.name, self.arm, self.frames(self.trajectory, 1)[0])

    def _held(self) -> tuple[int, ...]:
        held = self.iterations_per_point
        return tuple(held) if isinstance(held, (tuple, list)) else (held,)
