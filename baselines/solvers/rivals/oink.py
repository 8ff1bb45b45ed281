"""Oink, roboplan's inverse kinematics: weighted tasks under limits and barriers, solved by ProxQP in compiled code."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Annotated, Any, ClassVar

import numpy as np

from baselines.solvers.rivals.base import WHOLE_POSES, Step, Target
from baselines.solvers.rivals.model_files import TIP, geom_name, urdf
from baselines.solvers.rivals.solids import Solids, solids_of
from baselines.solvers.rivals.task_program import TaskProgram
from ikgym.validation import Bounds, FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class Roboplan(TaskProgram):
    """roboplan's Oink (Castro et al.): weighted tasks under limits; for the parameters see :class:`TaskProgram`.

    The model is handed over as URDF. Limits are those of position, velocity and acceleration with the braking distance
    that it needs. Where a program has no solution, ProxQP keeps the limits and barriers as nearly as it can.

    Where bodies matter, a `SelfCollisionBarrier` has all pairs of them and of obstacles, measured by coal.

    Args:
        tolerance: Of the program: largest residual, in [rad] or [m] a step, of a barrier in [m/s].
        iterations: Of ProxQP, at most. Where it needs more, the arm is stopped for this step.
        barrier_gain: γ of the barrier in [1/s]: a pair with the distance h to `clearance` may lose γ h / (1 + |h|) in a
            second.
        safe_displacement_gain: Of the barrier: damping by the squared norm of its Jacobian.
    """

    tolerance: Annotated[float, Bounds(above=0.0)] = 1e-6
    iterations: Annotated[int, Bounds(at_least=1)] = 100
    barrier_gain: Annotated[float, Bounds(above=0.0)] = 20.0
    safe_displacement_gain: Annotated[float, Bounds(at_least=0.0)] = 4e-4

    name: ClassVar[str] = "roboplan"
    keeps_acceleration: ClassVar[bool] = True
    package: ClassVar[str] = "roboplan.optimal_ik"
    distribution: ClassVar[str] = "roboplan-oink"
    #: Its frame task has one cost for all axes of the orientation.
    tasks: ClassVar[tuple[str, ...]] = (*WHOLE_POSES, "position")

    def make_step(self) -> Step:
        """See :meth:`Rival.make_step`."""
        core, kinematics = self.import_package("roboplan.core"), self.import_package()
        solids, dt, n = solids_of(self.problem), self.problem.dt, self.model.joints
        scene = self._scene(core, solids)
        settings = kinematics.OinkSettings()
        settings.eps_abs, settings.max_iter, settings.warm_start = self.tolerance, self.iterations, False
        oink = kinematics.Oink(scene, settings)
        pose, moved = np.eye(4, order="F"), np.zeros(n)
        frame, *posture = tasks = self._tasks(core, kinematics, oink, scene)
        acceleration = kinematics.AccelerationLimit(oink, dt, np.array(self.problem.model.acceleration_limit))
        velocity = kinematics.VelocityLimit(oink, dt, np.array(self.model.velocity_limit))
        limits = [kinematics.PositionLimit(oink, self.limit_gain), velocity, acceleration]
        barriers = self._barriers(kinematics, oink, scene, solids)

        def step(target: Target) -> FloatArray | None:
            pose[:3, :3], pose[:3, 3] = target.rotation, target.position
            frame.setTargetFrameTransform(pose)
            for task in posture:
                task.setTargetConfiguration(target.start)
            acceleration.setLastVelocity(target.qdot)
            try:
                # Made anew, since ProxQP continues from its last step, and a policy depends on its observation alone.
                kinematics.Oink(scene, settings).solveIk(target.q, tasks, limits, barriers, moved, self.damping)
            except RuntimeError:
                return None
            return moved / dt

        return step

    def _scene(self, core: Any, solids: Solids) -> Any:
        """The arm among its obstacles, which checks the pairs of the problem alone."""
        scene = core.Scene(self.name, core.loadUrdfSceneDescriptionFromXml(urdf(self.model, solids)))
        names = [geom_name(i) for i in range(len(solids.each))]
        scene.setCollisions(list(itertools.combinations(names, 2)), False)
        scene.setCollisions([(names[i], names[j]) for i, j in solids.pairs], True)
        return scene

    def _tasks(self, core: Any, kinematics: Any, oink: Any, scene: Any) -> list[Any]:
        """The frame task, then the posture task if there is one. Their costs are factors of squared errors."""
        position, orientation = (costs[0] ** 2 for costs in self.frame_costs)
        options = kinematics.FrameTaskOptions(position, orientation, self.gain, self.lm_damping)
        target = core.CartesianConfiguration("", TIP, np.eye(4, order="F"))
        frame = kinematics.FrameTask(oink, scene, target, options)
        if not self.posture_cost:
            return [frame]
        n = self.model.joints
        options = kinematics.ConfigurationTaskOptions(self.share)
        return [frame, kinematics.ConfigurationTask(oink, np.zeros(n), np.full(n, self.posture_cost**2), options)]

    def _barriers(self, kinematics: Any, oink: Any, scene: Any, solids: Solids) -> list[Any]:
        if not solids.pairs:
            return []
        options = kinematics.SelfCollisionBarrierOptions(
            len(solids.pairs), self.barrier_gain, self.safe_displacement_gain, self.clearance
        )
        return [kinematics.SelfCollisionBarrier(oink, scene, self.problem.dt, options)]
