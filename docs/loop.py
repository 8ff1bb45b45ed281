"""The table `loop`: the control loop on drives with delay and lag.

The Panda, without limits of acceleration as from a URDF file, moves its tool on a circle of 0.1 m at 0.1 m/s for two
seconds. Errors count after the first one. A command is compared with the largest velocity that the same joint has on
perfect drives.
"""

from __future__ import annotations

import itertools
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
    fields: dict[str, Any] = {"dt": period, "steps": round(seconds / period), "start": start}
    return ikgym.Scenario("loop", arm, ikgym.tasks.get("pose"), trajectory, **fields)


def with_drives(scenario: ikgym.Scenario, drives: Drives) -> ikgym.Scenario:
    """The same on drives with a delay and a lag."""
    bandwidth = np.inf if drives.bandwidth is None else drives.bandwidth
    return scenario.replace(plant=ikgym.Plant(command_delay=drives.delay, bandwidth=bandwidth))


def played(controller: Controller, scenario: ikgym.Scenario) -> tuple[Any, Any]:
    """Position errors in [m], and commands in [rad/s]. Shapes (k,) and (k, n)."""
    env: Any = ikgym.RedundantIKEnv(scenario, preview=controller.ahead)
    (seen, _), errors, commands = env.reset(seed=0), [], []
    for _ in range(scenario.steps):
        commands.append(controller.step(seen["q"], seen["pose"], seen["nominal"]))
        seen, *_, info = env.step((commands[-1] / scenario.velocity_limit).astype(np.float32))
        errors.append(info["position_error"])
    return np.array(errors), np.array(commands)


def peaks(scenario: ikgym.Scenario, policy: str = "qp") -> Any:
    """The largest joint velocities on perfect drives, in [rad/s] or [m/s]. Shape (n,)."""
    return np.abs(baselines.track(scenario, policy).qdot).max(axis=0)


def line(policy: str, told: str, period: float, lag: float | None, delay: int) -> Line:
    """One line of the table."""
    arm, drives = ikgym.arms.get("panda"), Drives(delay, lag)
    scenario = circle(arm.replace(acceleration_limit=np.full(7, np.inf)), arm.home, period)
    lost = Guards(position_error=None, orientation_error=None)
    known = {"perfect": Drives(), "given": drives, "identify": "identify"}[told]
    errors, commands = played(Controller(scenario, policy, known, guards=lost), with_drives(scenario, drives))
    case = {"policy": policy, "drives": told, "period_ms": 1e3 * period, "lag_ms": 1e3 * (lag or 0.0), "delay": delay}
    times = (np.abs(commands).max(axis=0) / peaks(scenario, policy)).max()
    return case | {"error_um": 1e6 * float(errors[round(FIRST / period) :].max()), "times_peak": float(times)}


def measured() -> list[Line]:
    """The table."""
    return [line(*loop, *case) for loop, *case in itertools.product(LOOPS, PERIODS, LAGS, DELAYS)]
