"""One episode of one policy as a trajectory: times, joint coordinates and velocities, errors, costs."""

from __future__ import annotations

import dataclasses
import os
import pathlib
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from baselines.episodes import Episode, add_up
from baselines.evaluation.export import Motion, by_joint, joint_trajectory, mcap, table
from baselines.evaluation.foreign import Wrap
from baselines.evaluation.jobs import job_of
from baselines.evaluation.log import trajectory_log
from baselines.evaluation.plots import tracking as picture
from baselines.evaluation.policies import AnyPolicy
from baselines.evaluation.run import play
from baselines.files import write
from baselines.status import Status
from ikgym import scenarios
from ikgym.scenarios import Preview, Scenario
from ikgym.validation import FloatArray, whole_number


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Tracking(Episode):
    """The record of an episode, see :class:`baselines.episodes.Episode`, and its files; all arrays are read-only.

    Args:
        policy: The name of the policy, as rows of an evaluation have it.
        parameters: The parameters of the policy, as far as they are known.
    """

    policy: str
    parameters: dict[str, Any]

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @property
    def seed(self) -> int:
        """The reset seed."""
        return self.seeds.seed

    @property
    def times(self) -> FloatArray:
        """Ends of the steps, in [s]. Shape (steps,)."""
        return self.scenario.times(len(self.q) + 1)[1:]

    @property
    def nominal(self) -> FloatArray:
        """Task coordinates of the reference trajectory. Shape (steps, m)."""
        return self.scenario.nominal(self.seed)[1:]

    @property
    def total_cost(self) -> float:
        """Sum of −reward, as in the row of an evaluation."""
        return float(add_up(self.cost))

    @property
    def motion(self) -> Motion:
        """The joint motion from the start on."""
        return Motion.of(self)

    @property
    def solver_status(self) -> Status:
        """The worst status that the solver reported."""
        return Status(int(self.status.max()))

    def columns(self) -> dict[str, npt.NDArray[Any]]:
        """All numbers by name and unit, one number a step, as :meth:`to_csv` writes them."""
        arm = self.scenario.arm
        out: dict[str, npt.NDArray[Any]] = {"time [s]": self.times}
        out |= {**by_joint(arm, self.q), **by_joint(arm, self.qdot, "/s")}
        for name, values in (("pose", self.pose), ("nominal", self.nominal)):
            # The position comes last; parts of a rotation have no unit.
            parts = [("1" if i < values.shape[1] - 3 else "m") for i in range(values.shape[1])]
            out |= {f"{name}{i} [{unit}]": values[:, i - 1] for i, unit in enumerate(parts, 1)}
        out["position_error [m]"] = self.position_error
        out["orientation_error [rad]"] = self.orientation_error
        out["tracking_cost [1]"] = self.tracking_cost
        out["velocity_cost [1]"] = self.velocity_cost
        if (near := self.proximity_cost) is not None:
            out["proximity_cost [1]"] = near
        out["solver_status"] = np.array([Status(status).label for status in self.status.tolist()])
        return out

    def to_csv(self, file: str | os.PathLike[str]) -> None:
        """Writes one line a step; the head has the units, NaN is an empty cell.

        Raises:
            ResultsError: The file cannot be written.
        """
        write(pathlib.Path(file), table(self.columns()))

    def to_joint_trajectory(self, file: str | os.PathLike[str], *, accelerations: bool = False) -> None:
        """Writes the joint motion, from rest to rest, as a ROS 2 `JointTrajectory` in JSON; accelerations on request.

        Raises:
            InvalidInputError: The episode ends in motion, and has no room to stop.
            ResultsError: The file cannot be written.
        """
        write(pathlib.Path(file), joint_trajectory(self, accelerations))

    def to_mcap(self, file: str | os.PathLike[str], *, accelerations: bool = False) -> None:
        """Likewise as an MCAP file, by rosbags; see :meth:`to_joint_trajectory`."""
        write(pathlib.Path(file), mcap(self, accelerations))

    def plot(self) -> Figure:
        """Task coordinates with those of the reference, and errors, over time, at the steps that count."""
        return picture.draw(f"{self.scenario.name}: {self.policy}", trajectory_log(self))


def track(
    scenario: str | Scenario,
    policy: AnyPolicy,
    *,
    seed: int = 0,
    preview: Preview | None = None,
    steps: int | None = None,
    wrap: Wrap | None = None,
) -> Tracking:
    """Plays one episode, from the reset to the end.

    >>> baselines.track("varga7-fast", "dls").to_csv("dls.csv")

    Args:
        scenario: The scenario, as :func:`ikgym.scenarios.find` takes it.
        policy: The policy, as :func:`baselines.evaluate.evaluate` takes it.
        seed: The reset seed.
        preview: Steps ahead that the policy is shown, or which ones; the policy's if left out.
        steps: Most steps; all of the scenario if left out.
        wrap: Wraps the environment for a policy that is no :class:`baselines.SolverPolicy`.

    Raises:
        UnknownNameError: There is no such scenario, policy or parameter.
        InvalidInputError: A value is out of range, the policy does not suit the scenario, is shown too little, or
            chooses an invalid action.
    """
    found = scenarios.find(scenario)
    if steps is not None:
        found = found.replace(steps=min(whole_number("steps", steps, at_least=1), found.steps))
    job = job_of(policy, found, whole_number("seed", seed, at_least=0), preview, wrap)
    ((row, episode),) = play((job,))
    assert episode is not None  # since the job asks for it
    return Tracking(**vars(episode), policy=row.policy, parameters=row.parameters)
