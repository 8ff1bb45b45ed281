"""The scenario: everything that an environment, a solver or an oracle is built from, as one frozen object."""

from __future__ import annotations

import dataclasses
import functools
import math
import os
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from ikgym.arms import Arm
from ikgym.arms.limits import farthest, jerk_limits, velocity_scale
from ikgym.cost import ProximityCost, TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.bodies import Surroundings
from ikgym.kernels.kinematics import Chain, add_arm_axis
from ikgym.kernels.rotations import geodesic_angle, quaternion_of
from ikgym.kernels.simulation import nominal_rows
from ikgym.obstacles import MOST_OBSTACLES, Obstacle, random_boxes
from ikgym.obstacles.solids import solids_of
from ikgym.plant import DrawnPlant, Plant
from ikgym.plant.draw import Draws, arm_key, episode_key
from ikgym.plant.response import deflection, fastest
from ikgym.scenarios import files
from ikgym.scenarios.preview import Preview, furthest
from ikgym.tasks import Task
from ikgym.trajectories import Trajectory, first_joints_of, frames_of
from ikgym.trajectories.orientations import matrices
from ikgym.validation import (
    LARGEST,
    FloatArray,
    Positive,
    about,
    check_memory,
    flag,
    frozen_array,
    gib,
    known_names,
    read_only,
    shorten,
    whole_number,
)

#: Most steps of an episode, and of a nominal point: a day of work at 1 kHz.
MOST_STEPS = 100_000_000
#: Largest cost of an episode: squares of costs stay finite.
LARGEST_COST = 1e150
#: Steps of an episode whose trajectory never ends, or is drawn.
USUAL_STEPS = 1000
#: Rest after the end of a path, in [s], in an episode without a number of steps.
REST = 0.25
# A start given by `options={"q": …}` may be this far from home in each joint, in [rad] or [m].
START_RANGE = 2.0 * np.pi
# Positions this many times the length of the arm away are more likely in [mm] than in [m].
MILLIMETRES = 50.0


@dataclasses.dataclass(frozen=True, eq=False)
class Scenario(Frozen):
    """A tracking problem: arm, nominal trajectory, task coordinates, cost and time.

    Args:
        name: Name of the scenario.
        arm: The arm that moves and is measured, apart from the deviations of the plant.
        task: The task coordinates.
        trajectory: The nominal trajectory; X^N(k) is its pose at the time k Δt.
        velocity_limit: The joint velocity of an action of 1, in [rad/s] or [m/s]. A number, or one a joint. By default
            the arm's velocity limits, if all of them are finite.
        cost: The stage cost. The worst episode costs at most 1e150.
        dt: Δt in [s].
        steps: Steps of an episode, 100,000,000 at most. By default those of the whole path and 0.25 s of rest; 1000 for
            trajectories that never end or are drawn.
        model: The arm that solvers know, and through which nominal joint paths are mapped; by default the arm itself.
        start: Joint coordinates at the start in [rad] or [m], within the limits of the arm. By default
            the nominal or published ones, or for other Cartesian trajectories those that :meth:`Arm.inverse` finds for
            the first pose. Shape (n,).
        initial_pose: Measured pose at the start, where it is not the arm's. Shape (m,).
        iterations_per_point: Steps for which the nominal points 1, 2, … are held; the last number holds for all later
            points. Errors and costs of a point count at its last step.
        plant: Deviations of the arm, its drives and its sensors from the data sheet; none by default.
        obstacles: Obstacles at rest or moving, at most 1000, with different names.
        collisions: Whether an arm whose bodies touch each other or an obstacle is stopped for the rest of the episode.
            By default it is where there are obstacles. The meshes of an arm from a URDF file are opened then, and each
            link needs a body, see :attr:`Bodies.unseen`.
        proximity: The cost of bodies that come near, in a scenario with collisions; none by default.
        policy: A policy that follows the path closely, such as ``"sns"``: the default of commands that show episodes.
        source: Origin of the scenario.
        jerk_limit: Largest changes of the joint accelerations in [rad/s³] or [m/s³], which the policies `qp`, `qp_path`
            and `sns` and the control loop keep; no limit of the plant. A number, or one a joint; inf for none. By
            default those of the arm.

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
    dt: Positive = 1e-3
    steps: int = None  # type: ignore[assignment]  # those of the path
    model: Arm = None  # type: ignore[assignment]  # the arm itself
    start: FloatArray | None = None
    initial_pose: FloatArray | None = None
    iterations_per_point: int | tuple[int, ...] = (1,)
    plant: Plant = dataclasses.field(default_factory=Plant)
    obstacles: Sequence[Obstacle] = ()
    collisions: bool | None = None
    proximity: ProximityCost | None = None
    policy: str | None = None
    source: str = ""
    jerk_limit: FloatArray = None  # type: ignore[assignment]  # that of the arm

    def __post_init__(self) -> None:
        self._settle(model=self.arm if self.model is None else self.model)
        with about(f"Scenario {shorten(self.name)}"):
            super().__post_init__()
        collides = self.collisions is True or (self.collisions is None and self.obstacles not in ((), []))
        if collides and self.arm.urdf is not None:
            from ikgym.arms.urdf import open_meshes  # arms without a file need no reader of files

            arm = open_meshes(self.arm)
            self._settle(model=arm if self.model is self.arm else self.model, arm=arm)
        self._check_parts()
        self._settle(velocity_limit=velocity_scale(self.arm, self.velocity_limit))
        self._settle(jerk_limit=jerk_limits(self.arm, self.jerk_limit))
        if self.start is not None:
            self._settle(start=frozen_array("start", self.start, (self.joints,), at_most=LARGEST))
        elif self.random and not self.starts_nominally:
            raise InvalidInputError(f"Scenario {self.name!r}: a random Cartesian trajectory needs a start.")
        if self.initial_pose is not None:
            pose = frozen_array("initial_pose", self.initial_pose, (self.task.size,), at_most=LARGEST)
            self._settle(initial_pose=pose)
        held = self.iterations_per_point
        held = tuple(held) if isinstance(held, (tuple, list)) else (held,)
        if not held:
            raise InvalidInputError("iterations_per_point: expected at least one number, got none.")
        self._settle(iterations_per_point=tuple(self._step_count("iterations_per_point", each) for each in held))
        self._settle(steps=self._step_count("steps", self._default_steps() if self.steps is None else self.steps))
        self.plant.check(self.arm, self.steps)
        self._check_obstacles()
        if not self.starts_nominally or (self.arm.limited and not self.random):
            self.first_q(self.trajectory)  # raises if the arm cannot be there
        most = self.steps * self.largest_step_cost()
        if not most <= LARGEST_COST:  # nor is it NaN
            raise InvalidInputError(
                f"Scenario {self.name!r}: expected a cost of at most {LARGEST_COST:g} for the worst episode, got "
                f"{most:.3g}; lower the exponents of the cost, the velocity limit or the distances."
            )

    def _check_parts(self) -> None:
        """Checks that model, task and trajectory suit the arm."""
        name, arm, model, task = self.name, self.arm, self.model, self.task
        if model.joints != arm.joints:
            got = f"{model.name!r} with {model.joints}"
            raise InvalidInputError(f"model of scenario {name!r}: expected an Arm with {arm.joints} joints, got {got}.")
        self.trajectory.check(model)
        if task.has_orientation and not self.trajectory.has_orientation:
            raise InvalidInputError(
                f"Scenario {name!r}: task {task.name!r} needs orientations, the trajectory has none."
            )

    def _check_obstacles(self) -> None:
        """Checks obstacles, collisions and proximity against the other parts."""
        where, obstacles, arm = f"obstacles of scenario {self.name!r}: expected", self.obstacles, self.arm
        if not isinstance(obstacles, (tuple, list)) or not all(isinstance(each, Obstacle) for each in obstacles):
            raise InvalidInputError(f"{where} a list of obstacles, got {shorten(obstacles)}.")
        self._settle(obstacles=tuple(obstacles))
        if (count := sum(each.count for each in obstacles)) > MOST_OBSTACLES:
            raise InvalidInputError(f"{where} at most {MOST_OBSTACLES}, got {count}.")
        names = self.body_names
        if twice := {name for name in names if names.count(name) > 1}:
            raise InvalidInputError(
                f"{where} names that differ from each other and from those of bodies, got {min(twice)!r} twice."
            )
        for each in obstacles:
            known_names("body", each.ignored, arm.bodies.names)
        if self.draws_obstacles and not (self.random and self.trajectory.joint_bound() is not None):
            raise InvalidInputError(
                f"{where} the trajectory of a random joint motion, which drawn boxes keep clear, got a "
                f"{type(self.trajectory).__name__}."
            )
        if self.collisions is not None:
            flag("collisions", self.collisions)
        if self.collides:
            arm.bodies.check_seen(arm.name)
            if not len(arm.bodies):
                raise InvalidInputError(
                    f"collisions of scenario {self.name!r}: expected an arm with bodies, {arm.name!r} has none."
                )
        elif self.proximity is not None:
            raise InvalidInputError(
                f"proximity of scenario {self.name!r}: expected a scenario with collisions, got one without; they are "
                "switched on by obstacles, or by collisions = true."
            )

    def _step_count(self, name: str, value: int) -> int:
        """A checked number of steps; the message states the memory."""
        steps = whole_number(name, value, at_least=1)
        if steps > MOST_STEPS:
            raise InvalidInputError(
                f"{name}: expected a whole number of at most {MOST_STEPS}, got {steps}; their nominal points would "
                f"take about {gib(self._bytes_of(steps))} of memory."
            )
        return steps

    def _bytes_of(self, points: int) -> int:
        """About how much memory the nominal points of an episode take while they are computed."""
        # The joint path, the poses as rotations, positions, frames and a copy, and the numbers of the points.
        return 8 * points * (self.joints + 3 * 12)

    def _default_steps(self) -> int:
        """Steps for the whole path and a short rest; :data:`USUAL_STEPS` where there is no end."""
        time, held = duration(self.trajectory), self._held
        if time is None:
            return USUAL_STEPS
        points = math.ceil(time / self.dt - 1e-9) + math.ceil(REST / self.dt)
        return sum(held[:points]) + max(points - len(held), 0) * held[-1]

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one.

        A new arm is also the model if none is given. If an action of 1 meant the old arm's velocity limits, it means
        those of the new arm, where all of them are finite. An arm with other limits of jerk brings these.

        Raises:
            UnknownNameError: There is no field of that name.
            InvalidInputError: A new value is refused, or Δt changes below drives of low order, which belong to one.
        """
        if self.plant.drive and "plant" not in changes and changes.get("dt", self.dt) != self.dt:
            raise InvalidInputError(
                f"dt: expected {self.dt:g} s, to which the drives of low order of {self.name!r} belong, or another "
                f"plant with it; got {shorten(changes['dt'])}."
            )
        if "arm" in changes and self.model is self.arm:
            changes.setdefault("model", None)
        arm = changes.get("arm")
        limits_of_arm = np.array_equal(self.velocity_limit, self.arm.velocity_limit)
        if limits_of_arm and isinstance(arm, Arm) and np.isfinite(arm.velocity_limit).all():
            changes.setdefault("velocity_limit", None)
        if isinstance(arm, Arm) and not np.array_equal(arm.jerk_limit, self.arm.jerk_limit):
            changes.setdefault("jerk_limit", None)
        return super().replace(**changes)

    def save(self, file: str | os.PathLike[str]) -> None:
        """Writes the scenario to a TOML file, which :func:`ikgym.scenarios.load` reads; every number stays exact.

        An arm of this package is written as its name, one from a URDF file as a reference to that file, relative to
        the new one, and any other in numbers.

        Args:
            file: A name that ends in ``.toml``. A file that is there already is replaced.

        Raises:
            InvalidInputError: The scenario has a part that no file can hold, such as a trajectory of a user's class,
                or the file cannot be written. No file has changed then.
        """
        if type(self) is not Scenario:
            raise InvalidInputError(f"save: expected a Scenario itself, got a {type(self).__name__}.")
        fields = dict(self._fields())
        if np.array_equal(self.jerk_limit, self.arm.jerk_limit):
            fields["jerk_limit"] = None
        files.save(fields, file)

    @property
    def cut_off(self) -> float:
        """The time in [s] at the end of a path for which the steps do not suffice; 0 where they do."""
        time = duration(self.trajectory)
        missing = 0.0 if time is None else time - self.dt * float(self.points()[-1])
        return missing if missing > 1e-6 * self.dt else 0.0

    @property
    def joints(self) -> int:
        """The number of joints, n."""
        return self.arm.joints

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

    def first_q(self, trajectory: Trajectory) -> FloatArray:
        """Start of the arm of the data sheet in an episode, in [rad] or [m]. Shape (n,).

        Args:
            trajectory: Trajectory of the episode.

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
        if not self.shifts_start:
            return q
        start: FloatArray = self.shift_start(q[None], add_arm_axis(self.drawn_plant(seed, arm_seed).arm.chain))[0]
        return start

    @functools.cached_property
    def shifts_start(self) -> bool:
        """Whether episodes begin at the first pose of the arm that moves, which is not that of the data sheet."""
        return self.start is None and self.plant.other_arm

    def shift_start(self, q: FloatArray, chains: Chain) -> FloatArray:
        """Starts of other arms: each at the pose at which the arm of the data sheet would begin.

        Args:
            q: Starts of the arm of the data sheet in [rad] or [m]. Shape (k, n).
            chains: The k arms that move, see :func:`ikgym.arms.inverse.alike`.

        Returns:
            Joint coordinates in [rad] or [m], as near to the poses as the arms get within the limits. Shape (k, n).
        """
        from ikgym.arms.inverse import alike  # its kernels take longer to load than all arms

        return alike(self.arm, chains, q, oriented=self.task.has_orientation)

    def first_q_of(self, episodes: Sequence[Trajectory]) -> FloatArray:
        """Starts of the arm of the data sheet in several episodes, see :meth:`first_q`. Shape (k, n).

        Args:
            episodes: Trajectories of the k episodes.

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
        plant, limit = self.plant, self.velocity_limit
        travelled = self.start_bound() + self.steps * self.dt * fastest(plant, limit)
        travelled += deflection(plant, limit, self.dt)
        return np.minimum(travelled, farthest(self.arm))

    @property
    def largest_qdot(self) -> FloatArray:
        """The largest joint velocities that actions and the arm allow, in [rad/s] or [m/s]. Shape (n,)."""
        return np.minimum(self.velocity_limit, self.arm.velocity_limit)

    def largest_step_cost(self) -> float:
        """The largest cost of one step of any episode."""
        trajectory = self.trajectory
        if trajectory.random and trajectory.joint_bound() is None and type(trajectory).reach is Trajectory.reach:
            nominal = LARGEST  # a distribution with unknown reach
        else:
            nominal = trajectory.reach(self.times(int(self.points()[-1]) + 1), self.model)
        distance = self.plant.reach(self.arm, self.joint_bound()) + nominal
        # Parts of two rotations differ by 2 at most; a rotation vector is no longer than π.
        turned = np.pi if self.task.kind in (task_kernels.POSE, task_kernels.AXIS) else 2.0
        errors = np.array([distance] * 3 + [turned] * (self.task.error_size - 3))
        largest = self.cost.largest(errors, self.velocity_limit)
        return largest if self.proximity is None else largest + self.proximity.largest

    def start_bound(self) -> FloatArray:
        """Absolute joint coordinates that no start exceeds, in [rad] or [m]. Shape (n,)."""
        known = self.trajectory.first_joints_bound() if self.starts_nominally else np.abs(self._start)
        usual = np.full(self.joints, START_RANGE)
        reachable = np.maximum(usual, 0.0 if known is None else known)
        within = farthest(self.arm)
        return np.where(np.isfinite(within), within, reachable)

    @functools.cached_property
    def starts_nominally(self) -> bool:
        """Whether the trajectory determines the start: on its joint path, or at a published start."""
        return self.start is None and self.trajectory.first_joints_bound() is not None

    @functools.cached_property
    def _start(self) -> FloatArray:
        """The start of all episodes: the one that is given, or one at the first pose of a Cartesian trajectory."""
        if self.start is not None:
            return self.start
        return self._find_start(self.frames(self.trajectory, 1)[0])

    def _find_start(self, frame: FloatArray) -> FloatArray:
        """Joint coordinates within the limits at a frame, near to the home posture if there are some. Shape (n,)."""
        arm, rotation, position = self.arm, (frame[:9].reshape(3, 3) if len(frame) == 12 else None), frame[-3:]
        q, converged = arm.inverse(rotation, position)
        if not converged:
            distance, angle = distances(arm, q, rotation, position)
            gap = f"{distance:.3g} m" if rotation is None else f"{distance:.3g} m and {angle:.3g} rad"
            raise InvalidInputError(
                f"Scenario {self.name!r}: expected a trajectory that begins where arm {arm.name!r} can be, got one "
                f"that begins {gap} from the nearest joint coordinates that were found within its limits; "
                f"{_guess_mistake(arm, rotation, position)}."
            )
        return read_only(q)

    @property
    def random(self) -> bool:
        """Whether the reset seed chooses the trajectory."""
        return self.trajectory.random

    @property
    def varies(self) -> bool:
        """Whether episodes differ from reset to reset: in their trajectory, their arm, or their noise."""
        return self.random or self.plant.random

    def nominal(self, seed: int | None = None, preview: Preview = 0) -> FloatArray:
        """The nominal task coordinates X^N(0), X^N(1), … of an episode, one row a step.

        Args:
            seed: The reset seed; needed where the scenario is random.
            preview: Steps past the end of the episode, as in the environment.

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
            preview: Steps past the end of the episode.

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

    def points(self, preview: Preview = 0) -> npt.NDArray[np.int64]:
        """Numbers of the nominal points that are the target after k steps.

        Args:
            preview: Steps past the end of the episode.

        Returns:
            Numbers of points. Shape (steps + preview + 1,).

        Raises:
            InvalidInputError: There is no memory for that many points.
        """
        last = self.steps + furthest(preview)
        check_memory(f"The {last + 1} nominal points of an episode", self._bytes_of(last + 1))
        # Points that are held for longer than the episode are held to its end.
        *first, usual = (min(held, last + 1) for held in self._held)
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
            trajectory: Trajectory of the episode.
            points: Number of points.

        Returns:
            Frames. Shape (points, 12), or (points, 3) where the task has no orientation.
        """
        frames = trajectory.frames(self.times(points), self.model)
        return np.ascontiguousarray(frames if self.task.has_orientation else frames[:, -3:])

    def frames_of(self, episodes: Sequence[Trajectory], points: npt.NDArray[np.int64]) -> FloatArray:
        """The nominal frames of several episodes, each at different points; bit for bit those of :meth:`frames`.

        Args:
            episodes: Trajectories of the k episodes.
            points: Numbers of points. Shape (k, p).

        Returns:
            Frames. Shape (k, p, 12), or (k, p, 3) where the task has no orientation.
        """
        frames = frames_of(episodes, points.astype(np.float64) * self.dt, self.model)
        return frames if self.task.has_orientation else frames[..., -3:]

    def times(self, points: int) -> FloatArray:
        """Times of the nominal points in [s]. Shape (points,)."""
        return np.arange(points, dtype=np.float64) * self.dt

    @property
    def _held(self) -> tuple[int, ...]:
        return self.iterations_per_point  # type: ignore[return-value]  # as it was checked

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
        return random_boxes.fix_boxes(self.obstacles, self.drawn_obstacles(episodes, [generator])[0])

    @property
    def _step_times(self) -> FloatArray:
        """The times of the nominal points after 0, 1, … steps, in [s]. Shape (steps + 1,)."""
        return np.asarray(self.points() * self.dt)

    @property
    def body_names(self) -> tuple[str, ...]:
        """Names of the bodies of the arm and of all obstacles, as numbers of pairs count them."""
        return (*self.arm.bodies.names, *(name for obstacle in self.obstacles for name in obstacle.names))

    def pair_names(self, pair: Sequence[int]) -> tuple[str, str]:
        """The names of a pair that :meth:`ikgym.Arm.clearance` or an outcome has."""
        return self.body_names[pair[0]], self.body_names[pair[1]]


def duration(trajectory: Trajectory) -> float | None:
    """The time from rest to rest in [s]; None for a trajectory that never ends, or is drawn."""
    return None if trajectory.random else getattr(trajectory, "duration", None)


def distances(arm: Arm, q: FloatArray, rotation: FloatArray | None, position: FloatArray) -> tuple[float, float]:
    """Distances of an arm from a pose, in [m] and in [rad]; the angle is 0 without an orientation."""
    there_rotation, there = arm.forward(q)
    angle = 0.0 if rotation is None else float(geodesic_angle(rotation, there_rotation))
    return float(np.linalg.norm(there - position)), angle


def _guess_mistake(arm: Arm, rotation: FloatArray | None, position: FloatArray) -> str:
    """The mistake that most likely leads to a first pose out of reach."""
    reach, away = arm.reach(np.zeros(arm.joints)), float(np.linalg.norm(position))
    if away > MILLIMETRES * reach:
        return f"it is {away:.4g} m away, and the arm {reach:.3g} m long: are positions in [mm]? Expected [m]"
    if rotation is not None:
        w, x, y, z = quaternion_of(*rotation)
        for order, other in {"x, y, z, w": (z, w, x, y), "w, x, y, z": (x, y, z, w)}.items():
            if arm.inverse(matrices(np.array([other]))[0], position)[1]:
                return f"with quaternions read as {order} it is in reach: is that their order? Expected w, x, y, z"
    return "give a start, or another trajectory"
