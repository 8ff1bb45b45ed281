"""mink, on MuJoCo."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from baselines.solvers.rivals.base import Seen, Step
from baselines.solvers.rivals.model_files import TIP, joint_name, mjcf
from baselines.solvers.rivals.task_program import TaskProgram
from ikgym.validation import FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class Mink(TaskProgram):
    """mink (Zakka, on MuJoCo): weighted tasks under limits; for the parameters see :class:`TaskProgram`.

    The model is handed over as MJCF. Limits are those of position and velocity; it has none of acceleration.
    """

    limit_gain: float = 0.95

    name: ClassVar[str] = "mink"
    package: ClassVar[str] = "mink"
    distribution: ClassVar[str] = "mink"

    def make_step(self) -> Step:
        """See :meth:`Rival.make_step`."""
        mink, mujoco = self.imported(), self.imported("mujoco")
        model = mujoco.MjModel.from_xml_string(mjcf(self.model))
        configuration = mink.Configuration(model)
        frame = mink.FrameTask(TIP, "body", *self.frame_costs, gain=self.gain, lm_damping=self.lm_damping)
        posture = [mink.PostureTask(model, self.posture_cost, gain=self.share)] if self.posture_cost else []
        tasks = [frame, *posture]
        speeds = {joint_name(i): limit for i, limit in enumerate(self.model.velocity_limit) if np.isfinite(limit)}
        limits = [mink.ConfigurationLimit(model, self.limit_gain), mink.VelocityLimit(model, speeds)]
        dt, options = self.problem.dt, {"solver": self.solver, "damping": self.damping}
        pose = np.eye(4)

        def step(seen: Seen) -> FloatArray | None:
            configuration.update(seen.q)
            pose[:3, :3], pose[:3, 3] = seen.target
            for task in posture:
                task.set_target(seen.start)
            frame.set_target(mink.SE3.from_matrix(pose))
            try:
                found: FloatArray = mink.solve_ik(configuration, tasks, dt, limits=limits, **options)
            except mink.NoSolutionFound:
                return None
            return found

        return step
