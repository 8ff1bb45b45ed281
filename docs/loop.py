"""The table `loop`: the control loop on drives with delay and lag.

The Panda, without limits of acceleration and jerk as from a URDF file, moves its tool on a circle of 0.1 m at 0.1 m/s
for two seconds. Errors count after the first one. A command is compared with the largest velocity that the same joint
has on perfect drives.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import numpy.typing as npt

import baselines
import ikgym
from baselines import Controller, Drives, Guards
from docs.keeping import Line
from ikgym.trajectories.orientations import FixedOrientation
from ikgym.trajectories.path_trajectory import PathTrajectory
from ikgym.trajectories.paths import Circle
from ikgym.trajectories.time_laws import Trapezoidal

#: Policies, and what the controller knows of the drives.
LOOPS = (
    ("qp", "identify"),
    ("qp", "given"),
    ("rhc_foresight", "identify"),
    ("qp", "perfect"),
    ("qp:gain=0.06", "perfect"),
)
PERIODS, LAGS, DELAYS = (0.001, 0.004), (None, 0.02), range(4)
SECONDS, FIRST = 2.0, 1.0
#: The columns of the circle's frame: to its start, along it, and its axis.
UPRIGHT = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def circle(arm: ikgym.Arm, start: npt.ArrayLike, period: float, seconds: float = SECONDS) -> ikgym.Scenario:
    """A scenario whose tool goes upright on the circle, from joint coordinates (n,) in [rad] or [m]; Δt in [s]."""
    rotation, position = arm.forward(start)
    path = Circle(position - 0.1 * UPRIGHT[:, 0], 0.1, rotation=UPRIGHT)
    trajectory = PathTrajectory(path, Trapezoidal(0.1, 0.5), FixedOrientation(rotation))
    fields: dict[str, Any] = {"dt": period, "steps": round(seconds / period), "start": start, "jerk_limit": np.inf}
    return ikgym.Scenario("loop", arm, ikgym.tasks.get("pose"), trajectory, **fields)


class DrivenArm:
    """Joints whose velocities follow commands with a delay and a lag of first order, in continuous time.

    Args:
        drives: Their delays and lags.
        q: Their start, in [rad] or [m]. Shape (n,).
        period: Δt in [s].
    """

    def __init__(self, drives: Drives, q: npt.ArrayLike, period: float) -> None:
        self.q: Any = np.array(q, dtype=np.float64)
        n, self._period = len(self.q), period
        self._delay = np.broadcast_to(drives.delay, n)
        self._constant = np.maximum(np.broadcast_to(drives.time_constant or 0.0, n), 1e-12)
        self._qdot = np.zeros(n)
        self._commands = np.zeros((math.ceil(self._delay.max()) + 2, n))

    def move(self, qdot: npt.ArrayLike) -> None:
        """Moves the joints for a period, in which a command arrives; in [rad/s] or [m/s]. Shape (n,)."""
        self._commands = np.concatenate([[qdot], self._commands[:-1]])
        steps, joints = self._delay.astype(int), np.arange(len(self.q))
        first = (self._delay - steps) * self._period
        self._follow(self._commands[steps + 1, joints], first)
        self._follow(self._commands[steps, joints], self._period - first)

    def _follow(self, command: Any, time: Any) -> None:
        """Follows commands for some time in [s]. Shapes (n,)."""
        gap, left = self._qdot - command, np.exp(-time / self._constant)
        self.q += time * command + self._constant * (1.0 - left) * gap
        self._qdot = command + left * gap


def play(controller: Controller, scenario: ikgym.Scenario, drives: Drives) -> tuple[Any, Any]:
    """Position errors in [m] and commands in [rad/s] on such drives. Shapes (k,), (k, n)."""
    ahead, arm = controller.ahead, DrivenArm(drives, scenario.start_of(), scenario.dt)
    nominal, errors, commands = scenario.nominal(0, ahead), [], []
    for k in range(scenario.steps):
        commands.append(controller.step(arm.q, None, nominal[k + 1 : k + 1 + ahead]))
        arm.move(commands[-1])
        pose = scenario.task.coordinates(*scenario.arm.forward(arm.q))
        errors.append(np.linalg.norm(pose[-3:] - nominal[k + 1, -3:]))
    return np.array(errors), np.array(commands)


def peaks(scenario: ikgym.Scenario, policy: str = "qp") -> Any:
    """The largest joint velocities on perfect drives, in [rad/s] or [m/s]. Shape (n,)."""
    return np.abs(baselines.track(scenario, policy).qdot).max(axis=0)


def line(policy: str, given: str, period: float, lag: float | None, delay: int) -> Line:
    """One line of the table."""
    arm, drives = ikgym.arms.get("panda"), Drives(delay, lag)
    scenario = circle(arm.replace(acceleration_limit=np.full(7, np.inf)), arm.home, period)
    lost = Guards(position_error=None, orientation_error=None)
    known = {"perfect": Drives(), "given": drives, "identify": "identify"}[given]
    errors, commands = play(Controller(scenario, policy, known, guards=lost), scenario, drives)
    case = {"policy": policy, "drives": given, "period_ms": 1e3 * period, "lag_ms": 1e3 * (lag or 0.0), "delay": delay}
    times = (np.abs(commands).max(axis=0) / peaks(scenario, policy)).max()
    return case | {"error_um": 1e6 * float(errors[round(FIRST / period) :].max()), "times_peak": float(times)}


def measure() -> list[Line]:
    """The table."""
    return [line(*loop, *case) for loop, *case in itertools.product(LOOPS, PERIODS, LAGS, DELAYS)]
