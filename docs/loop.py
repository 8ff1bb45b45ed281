"""Measures the control loop on drives with delay and lag: ``python -m docs.loop``.

The Panda, without limits of acceleration as from a URDF file, moves its tool on a circle of 0.1 m at 0.1 m/s for two
seconds. Errors count after the first one. A command is compared with the largest velocity that the same joint has on
perfect drives.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import tyro

import baselines
import ikgym
from baselines import Controller, Drives, Guards
from baselines.evaluation.records import from_csv, to_csv
from baselines.files import write
from docs.measure import RESULTS
from ikgym.trajectories.orientations import FixedOrientation
from ikgym.trajectories.path_trajectory import PathTrajectory
from ikgym.trajectories.paths import Circle
from ikgym.trajectories.time_laws import Trapezoidal

#: Policies, and what the controller is told of the drives.
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


def measured(policy: str, told: str, period: float, lag: float | None, delay: int) -> dict[str, Any]:
    """One line of the table."""
    arm, drives = ikgym.arms.get("panda"), Drives(delay, lag)
    scenario = circle(arm.replace(acceleration_limit=np.full(7, np.inf)), arm.home, period)
    lost = Guards(position_error=None, orientation_error=None)
    known = {"perfect": Drives(), "given": drives, "identify": "identify"}[told]
    errors, commands = played(Controller(scenario, policy, known, guards=lost), with_drives(scenario, drives))
    line = {"policy": policy, "drives": told, "period_ms": 1e3 * period, "lag_ms": 1e3 * (lag or 0.0), "delay": delay}
    times = (np.abs(commands).max(axis=0) / peaks(scenario, policy)).max()
    return line | {"error_um": 1e6 * float(errors[round(FIRST / period) :].max()), "times_peak": float(times)}


def table() -> list[tuple[str, ...]]:
    """One row for each policy and control period, from `loop.csv`."""
    lines = from_csv((RESULTS / "loop.csv").read_text(encoding="utf-8"))
    columns = [(f"{float(lag or 0.0) * 1e3:g}", str(delay)) for lag, delay in itertools.product(LAGS, DELAYS)]
    rows: list[tuple[str, ...]] = [("policy", "drives", "Δt [ms]", *(f"{lag} ms, {delay}" for lag, delay in columns))]
    for (policy, told), period in itertools.product(LOOPS, PERIODS):
        here = {
            (f"{float(one['lag_ms']):g}", one["delay"]): _cell(one)
            for one in lines
            if (one["policy"], one["drives"], float(one["period_ms"])) == (policy, told, 1e3 * period)
        }
        rows.append((f"`{policy}`", told, f"{1e3 * period:g}", *(here[column] for column in columns)))
    return rows


def _cell(line: Mapping[str, str]) -> str:
    """Error in [µm] and peak, with two digits."""
    error, peak = float(line["error_um"]), float(line["times_peak"])
    return f"{error:,.0f}, {peak:.2g}" if error >= 10.0 else f"{error:.2g}, {peak:.2g}"


def main() -> None:
    """Writes `loop.csv`."""
    cases = itertools.product(LOOPS, PERIODS, LAGS, DELAYS)
    lines = [measured(*loop, period, lag, delay) for loop, period, lag, delay in cases]
    write(RESULTS / "loop.csv", to_csv(lines).encode())


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
