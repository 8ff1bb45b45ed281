"""Pink, on Pinocchio."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np

from baselines.solvers.rivals.base import Seen, Step
from baselines.solvers.rivals.model_files import TIP, urdf
from baselines.solvers.rivals.task_program import TaskProgram
from ikgym.validation import FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class Pink(TaskProgram):
    """Pink (Caron et al., `pin-pink`): weighted tasks under limits; for the parameters see :class:`TaskProgram`.

    The model is handed over as URDF. Limits are those of position, velocity and, where all joints have them,
    acceleration with the braking distance that it needs (`AccelerationLimit`). quadprog is the solver of its README;
    it keeps limits to rounding, where DAQP keeps them to 1e-6 rad a step.
    """

    solver: str = "quadprog"

    name: ClassVar[str] = "pink"
    package: ClassVar[str] = "pink"
    distribution: ClassVar[str] = "pin-pink"

    def make_step(self) -> Step:
        """See :meth:`Rival.make_step`."""
        pink, pinocchio = self.imported(), self.imported("pinocchio")
        model = pinocchio.buildModelFromXML(urdf(self.model))
        configuration = pink.Configuration(model, model.createData(), np.zeros(model.nq))
        frame = pink.tasks.FrameTask(TIP, *self.frame_costs, lm_damping=self.lm_damping, gain=self.gain)
        posture = [pink.tasks.PostureTask(self.posture_cost, gain=self.share)] if self.posture_cost else []
        tasks = [frame, *posture]
        limits = [pink.limits.ConfigurationLimit(model, self.limit_gain), pink.limits.VelocityLimit(model)]
        acceleration = self._acceleration(pink, model)
        limits += acceleration
        dt, options = self.problem.dt, {"solver": self.solver, "damping": self.damping, "safety_break": False}

        def step(seen: Seen) -> FloatArray | None:
            configuration.update(seen.q)
            frame.set_target(pinocchio.SE3(*seen.target))
            for task in posture:
                task.set_target(seen.start)
            for limit in acceleration:
                limit.set_last_integration(seen.qdot, dt)
            try:
                found: FloatArray = pink.solve_ik(configuration, tasks, dt, limits=limits, **options)
            except pink.exceptions.NoSolutionFound:
                return None
            return found

        return step

    def _acceleration(self, pink: Any, model: Any) -> list[Any]:
        limit = np.array(self.problem.model.acceleration_limit)
        return [pink.limits.AccelerationLimit(model, limit)] if np.isfinite(limit).all() else []
