"""The scenario: everything that an environment, a solver or an oracle is built from, as one frozen object."""

from __future__ import annotations

import dataclasses
import functools
import os
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from gymnasium.utils import seeding

from ikgym.arms import Arm
from ikgym.arms.limits import farthest, velocity_scale
from ikgym.arms.urdf import open_meshes
from ikgym.cost import ProximityCost, TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.kernels.kinematics import Chain, stacked
from ikgym.obstacles import Obstacle
from ikgym.plant import DrawnPlant, Plant
from ikgym.plant.draw import Draws, arm_key, episode_key
from ikgym.scenarios import checks, durations, files, starts
from ikgym.scenarios.surroundings import Surrounded
from ikgym.tasks import Task
from ikgym.trajectories import Trajectory, first_joints_of
from ikgym.validation import LARGEST, FloatArray, Positive, about, frozen_array, shortened

# A start given by `options={"q": …}` may be this far from home in each joint, in [rad] or [m].
START_RANGE = 2.0 * np.pi


@dataclasses.dataclass(frozen=True, eq=False)
class Scenario(Frozen, Surrounded):
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
            trajectories that go on for ever or are drawn.
        model: The arm that solvers know, and through which nominal joint paths are mapped; by default the arm itself.
        start: Joint coordinates at the start in [rad] or [m], within the limits of the arm. By default
            the nominal or published ones, or for other Cartesian trajectories those that :meth:`Arm.inverse` finds for
            the first pose. Shape (n,).
        initial_pose: Measured pose at the start, where it is not the arm's. Shape (m,).
        iterations_per_point: Steps for which the nominal points 1, 2, … are held; the last number holds for all later
            points. Errors and costs of a point count at its last step.
        plant: Deviations of the arm, its drives and its sensors from the data sheet; none by default.
        obstacles: Obstacles that stand or move, at most 1000, with different names.
        collisions: Whether an arm whose bodies touch each other or an obstacle is stopped for the rest of the episode.
            By default it is where there are obstacles. The meshes of an arm from a URDF file are opened then, and each
            link needs a body, see :attr:`Bodies.unseen`.
        proximity: The cost of bodies that come near, in a scenario with collisions; none by default.
        policy: A policy that follows the path closely, such as ``"sns"``: the default of commands that show episodes.
        source: Origin of the scenario.

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

    def __post_init__(self) -> None:
        self._settle(model=self.arm if self.model is None else self.model)
        with about(f"Scenario {shortened(self.name)}"):
            super().__post_init__()
        if self.collisions is True or (self.collisions is None and self.obstacles not in ((), [])):
            arm = open_meshes(self.arm)
            self._settle(model=arm if self.model is self.arm else self.model, arm=arm)
        checks.check_parts(self._fields())
        n = self.arm.joints
        self._settle(velocity_limit=velocity_scale(self.arm, self.velocity_limit))
        if self.start is not None:
            self._settle(start=frozen_array("start", self.start, (n,), at_most=LARGEST))
        elif self.random and not self.starts_nominally:
            raise InvalidInputError(f"Scenario {self.name!r}: a random Cartesian trajectory needs a start.")
        if self.initial_pose is not None:
            self._settle(
                initial_pose=frozen_array("initial_pose", self.initial_pose, (self.task.size,), at_most=LARGEST)
            )
        held = self._held()
        if not held:
            raise InvalidInputError("iterations_per_point: expected at least one number, got none.")
        held = tuple(checks.step_count("iterations_per_point", number_of_steps, n) for number_of_steps in held)
        self._settle(iterations_per_point=held)
        steps = durations.default_steps(self.trajectory, self.dt, held) if self.steps is None else self.steps
        self._settle(steps=checks.step_count("steps", steps, n))
        self.plant.check(self.arm, self.steps)
        self._settle(obstacles=checks.obstacles(self._fields()))
        if not self.starts_nominally or (self.arm.limited and not self.random):
            self.first_q(self.trajectory)  # raises if the arm cannot be there
        checks.check_cost(self.name, self.largest_step_cost(), self.steps)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one.

        A new arm is its own model if none is given. If an action of 1 meant the old arm's velocity limits, it means
        those of the new arm, where all of them are finite.

        Raises:
            UnknownNameError: There is no field of that name.
            InvalidInputError: A new value is refused.
        """
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
        files.save(self._fields(), file)

    @property
    def cut_off(self) -> float:
        """The time in [s] at the end of a path for which the steps do not suffice; 0 where they do."""
        time = durations.duration(self.trajectory)
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
        if not self.jogs:
            return q
        start: FloatArray = self.jogged(q[None], stacked(self.drawn_plant(seed, arm_seed).arm.chain))[0]
        return start

    @functools.cached_property
    def jogs(self) -> bool:
        """Whether episodes begin at the first pose of the arm that moves, which is not that of the data sheet."""
        return self.start is None and self.plant.other_arm

    def jogged(self, q: FloatArray, chains: Chain) -> FloatArray:
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
        added: FloatArray = np.abs(self.plant.bias) + np.abs(self.plant.noise)
        travelled = self.start_bound() + self.steps * self.dt * (self.velocity_limit + added)
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
        largest = checks.largest_step_cost(self.task, self.cost, self.velocity_limit, distance)
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
        return starts.found(self.name, self.arm, self.frames(self.trajectory, 1)[0])
