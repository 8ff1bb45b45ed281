"""Pink and mink: weighted tasks under limits, one quadratic program a step."""

from __future__ import annotations

import abc
import dataclasses
from typing import Annotated, Any, ClassVar

import numpy as np

from baselines.solvers.rivals.base import Rival, Step, Target
from baselines.solvers.rivals.model_files import TIP, geom_name, joint_name, mjcf, urdf
from baselines.solvers.rivals.solids import Solids, geometry_model, solids_of
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.validation import Bounds, FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class TaskProgram(Rival, abc.ABC):
    """Minimises a frame task and a posture task under the limits of position and velocity.

    ‖W (J Δq − gain · e)‖² + μ ‖Δq‖² + posture_cost² ‖Δq − posture_rate Δt (q* − q)‖² + damping ‖Δq‖², with W of
    `position_cost` and `orientation_cost`, and μ of `lm_damping`. q* is the posture at the start. Costs and damping are
    those of Pink's example of an arm. There the posture task asks for the whole way back in one step; here for that
    share of it which takes a second, since the other loses the arm on `panda-singular`.

    Args:
        problem: The scenario as the policy knows it.
        gain: Of the frame task. Above 0, at most 1; 1 is deadbeat control.
        position_cost: Of the frame task, in [1/m].
        orientation_cost: Of the frame task, in [1/rad].
        lm_damping: μ by the squared cost of the error: Levenberg–Marquardt damping of the frame task.
        posture_cost: In [1/rad]; 0 for no posture task.
        posture_rate: Share of the way to the posture that is asked for in a second, in [1/s].
        damping: Of the whole program.
        limit_gain: Share of the distance to a position limit that a step may take. Above 0, at most 1.
        clearance: Distance that bodies keep from each other and from obstacles, in [m]. At least 0.

    Raises:
        InvalidInputError: See :class:`Rival`; a parameter is out of its range; or obstacles move or are drawn.
        MissingDependencyError: The package is not installed.
    """

    gain: Annotated[float, Bounds(above=0.0, at_most=1.0)] = 1.0
    position_cost: Annotated[float, Bounds(above=0.0)] = 1.0
    orientation_cost: Annotated[float, Bounds(at_least=0.0)] = 1.0
    lm_damping: Annotated[float, Bounds(at_least=0.0)] = 1.0
    posture_cost: Annotated[float, Bounds(at_least=0.0)] = 1e-3
    posture_rate: Annotated[float, Bounds(at_least=0.0)] = 1.0
    damping: Annotated[float, Bounds(at_least=0.0)] = 1e-12
    limit_gain: Annotated[float, Bounds(above=0.0, at_most=1.0)] = 0.5
    clearance: Annotated[float, Bounds(at_least=0.0)] = 0.005

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.problem.obstacles_shown:
            raise InvalidInputError(
                f"{self.name}: expected obstacles at rest that are the same in all episodes, since its model is made "
                "once; got some that move or are drawn."
            )
        if self.share > 1.0:
            raise InvalidInputError(f"posture_rate · Δt: expected at most 1, got {self.share:g}.")

    @property
    def frame_costs(self) -> tuple[list[float], list[float]]:
        """Costs of the frame task along the tool's axes, of its position and of its orientation."""
        turns = {"position": [0.0] * 3, "axis": [self.orientation_cost, self.orientation_cost, 0.0]}
        return [self.position_cost] * 3, turns.get(self.problem.task.name, [self.orientation_cost] * 3)

    @property
    def share(self) -> float:
        """Of the way to the posture that is asked for in one step."""
        return self.posture_rate * self.problem.dt


@dataclasses.dataclass(frozen=True, eq=False)
class SolverProgram(TaskProgram, abc.ABC):
    """A program that `qpsolvers` solves.

    Args:
        solver: Of the program, a name of `qpsolvers`.

    Raises:
        InvalidInputError: See :class:`TaskProgram`.
        UnknownNameError: There is no such solver, or it is not installed.
        MissingDependencyError: The package, or `qpsolvers`, is not installed.
    """

    solver: str = "daqp"

    def __post_init__(self) -> None:
        super().__post_init__()
        known = self.import_package("qpsolvers").available_solvers
        if self.solver not in known:
            raise UnknownNameError("solver of quadratic programs", self.solver, tuple(known))


@dataclasses.dataclass(frozen=True, eq=False)
class Pink(SolverProgram):
    """Pink (Caron et al., `pin-pink`): weighted tasks under limits; for the parameters see :class:`TaskProgram`.

    The model is handed over as URDF. Limits are those of position, velocity and, where all joints have them,
    acceleration with the braking distance that it needs (`AccelerationLimit`). quadprog is the solver of its README;
    it keeps limits to rounding, where DAQP keeps them to 1e-6 rad a step.

    Where bodies matter, a `SelfCollisionBarrier` has all pairs of them and of obstacles, measured by coal.

    Args:
        barrier_gain: Share of the distance to `clearance` that a pair may lose in a second, in [1/s].
        safe_displacement_gain: Of the barrier: damping by the squared norm of its Jacobian.
    """

    solver: str = "quadprog"
    barrier_gain: Annotated[float, Bounds(above=0.0)] = 20.0
    safe_displacement_gain: Annotated[float, Bounds(at_least=0.0)] = 4e-4

    name: ClassVar[str] = "pink"
    keeps_acceleration: ClassVar[bool] = True
    package: ClassVar[str] = "pink"
    distribution: ClassVar[str] = "pin-pink"

    def make_step(self) -> Step:
        """See :meth:`Rival.make_step`."""
        pink, pinocchio = self.import_package(), self.import_package("pinocchio")
        model = pinocchio.buildModelFromXML(urdf(self.model))
        solids = solids_of(self.problem)
        geometry = geometry_model(solids, pinocchio, self.import_package("coal")) if solids.pairs else None
        configuration = pink.Configuration(model, model.createData(), np.zeros(model.nq), collision_model=geometry)
        frame = pink.tasks.FrameTask(TIP, *self.frame_costs, lm_damping=self.lm_damping, gain=self.gain)
        posture = [pink.tasks.PostureTask(self.posture_cost, gain=self.share)] if self.posture_cost else []
        tasks = [frame, *posture]
        most = np.array(self.problem.model.acceleration_limit)
        acceleration = [pink.limits.AccelerationLimit(model, most)] if np.isfinite(most).all() else []
        limits = [pink.limits.ConfigurationLimit(model, self.limit_gain), pink.limits.VelocityLimit(model)]
        limits += acceleration
        dt, options = self.problem.dt, {"solver": self.solver, "damping": self.damping, "safety_break": False}
        options["barriers"] = self._barriers(pink, solids)

        def step(target: Target) -> FloatArray | None:
            configuration.update(target.q)
            frame.set_target(pinocchio.SE3(target.rotation, target.position))
            for task in posture:
                task.set_target(target.start)
            for limit in acceleration:
                limit.set_last_integration(target.qdot, dt)
            try:
                found: FloatArray = pink.solve_ik(configuration, tasks, dt, limits=limits, **options)
            except pink.exceptions.NoSolutionFound:
                return None
            return found

        return step

    def _barriers(self, pink: Any, solids: Solids) -> list[Any]:
        options = {"safe_displacement_gain": self.safe_displacement_gain, "d_min": self.clearance}
        make, pairs = pink.barriers.SelfCollisionBarrier, len(solids.pairs)
        return [make(pairs, self.barrier_gain, **options)] if pairs else []


@dataclasses.dataclass(frozen=True, eq=False)
class Mink(SolverProgram):
    """mink (Zakka, on MuJoCo): weighted tasks under limits; for the parameters see :class:`TaskProgram`.

    The model is handed over as MJCF. Limits are those of position and velocity; it has none of acceleration. Where
    bodies matter, a `CollisionAvoidanceLimit` has all pairs of them and of obstacles, measured by MuJoCo.

    Args:
        collision_gain: Share of the distance to `clearance` that a pair may lose in a step. Above 0, at most 1.
        detection_distance: Distance from which on a pair is looked at, in [m].
    """

    limit_gain: float = 0.95
    collision_gain: Annotated[float, Bounds(above=0.0, at_most=1.0)] = 0.85
    detection_distance: Annotated[float, Bounds(above=0.0)] = 0.01

    name: ClassVar[str] = "mink"
    package: ClassVar[str] = "mink"
    distribution: ClassVar[str] = "mink"

    def make_step(self) -> Step:
        """See :meth:`Rival.make_step`."""
        mink, mujoco = self.import_package(), self.import_package("mujoco")
        solids = solids_of(self.problem)
        model = mujoco.MjModel.from_xml_string(mjcf(self.model, solids))
        configuration = mink.Configuration(model)
        frame = mink.FrameTask(TIP, "body", *self.frame_costs, gain=self.gain, lm_damping=self.lm_damping)
        posture = [mink.PostureTask(model, self.posture_cost, gain=self.share)] if self.posture_cost else []
        tasks = [frame, *posture]
        speeds = {joint_name(i): limit for i, limit in enumerate(self.model.velocity_limit) if np.isfinite(limit)}
        limits = [mink.ConfigurationLimit(model, self.limit_gain), mink.VelocityLimit(model, speeds)]
        limits += self._collisions(mink, model, solids)
        dt, options = self.problem.dt, {"solver": self.solver, "damping": self.damping}
        pose = np.eye(4)

        def step(target: Target) -> FloatArray | None:
            configuration.update(target.q)
            pose[:3, :3], pose[:3, 3] = target.rotation, target.position
            for task in posture:
                task.set_target(target.start)
            frame.set_target(mink.SE3.from_matrix(pose))
            try:
                found: FloatArray = mink.solve_ik(configuration, tasks, dt, limits=limits, **options)
            except mink.NoSolutionFound:
                return None
            return found

        return step

    def _collisions(self, mink: Any, model: Any, solids: Solids) -> list[Any]:
        pairs = [([geom_name(i)], [geom_name(j)]) for i, j in solids.pairs]
        # mink 1.3 allows a step to take gain / Δt of the distance instead of gain.
        numbers = self.collision_gain * self.problem.dt, self.clearance, self.detection_distance
        return [mink.CollisionAvoidanceLimit(model, pairs, *numbers)] if pairs else []
