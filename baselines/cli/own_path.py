"""An arm and a path of the user, as options that several commands have."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
from typing import Annotated, Any

import tyro

from baselines.cli.parsing import Rule
from baselines.paths.survey import RESERVE
from ikgym import arms, scenarios, tasks
from ikgym.arms import Arm
from ikgym.arms.urdf import open_meshes
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.frozen import Frozen
from ikgym.scenarios import Scenario
from ikgym.trajectories import from_csv
from ikgym.validation import Bounds, per_joint

#: Where nobody states the acceleration of the tool, it comes to its speed within this time in [s].
SPEEDING_UP = 0.2


@dataclasses.dataclass(frozen=True, kw_only=True)
class RobotOptions(Frozen):
    """The chain of a URDF file, and the facts that the file does not state."""

    base: Annotated[str | None, tyro.conf.arg(metavar="LINK")] = None
    """Link of a URDF file at which the arm begins; the root if left out."""
    tip: Annotated[str | None, tyro.conf.arg(metavar="LINK")] = None
    """Link at which it ends; needed where several could."""
    tool: Annotated[tuple[float, float, float] | None, tyro.conf.arg(metavar="X Y Z")] = None
    """Tool point in the frame of the tip, in [m]."""
    acceleration: Annotated[tuple[float, ...], tyro.conf.arg(metavar="A …")] = ()
    """Acceleration limit, or one a joint, in [rad/s²] or [m/s²]; a URDF file states none."""
    jerk: Annotated[tuple[float, ...], tyro.conf.arg(metavar="J …")] = ()
    """Limit of jerk, or one a joint, in [rad/s³] or [m/s³]; that of the arm if left out, where it states one."""

    packages: Annotated[tuple[str, ...], tyro.conf.arg(metavar="DIR …")] = ()
    """Folders in which packages of meshes are searched, before those above the URDF file."""
    bodyless: Annotated[tuple[str, ...], tyro.conf.arg(metavar="LINK …")] = ()
    """Links that need no body, since they may touch."""

    def robot(self, name: str) -> Arm:
        """The arm of a URDF file, or of the catalogue by its name."""
        if not name.endswith(".urdf"):
            return self.with_limits(arms.get(name))
        return self.with_limits(
            arms.from_urdf(
                name,
                base=self.base,
                tip=self.tip,
                tool=self.tool,
                packages=self.packages,
                bodyless=self.bodyless,
            )
        )

    def with_limits(self, arm: Arm) -> Arm:
        """The arm with the limits of acceleration and jerk that are given; the same where none are."""
        given = {"acceleration": self.acceleration, "jerk": self.jerk}
        limits = {
            f"{name}_limit": per_joint(f"--{name}", values[0] if len(values) == 1 else values, arm.joints)
            for name, values in given.items()
            if values
        }
        return arm.replace(**limits) if limits else arm


#: The names of these options.
ROBOT_OPTIONS = ("--base", "--tip", "--tool", "--packages", "--bodyless", "--acceleration", "--jerk")


@dataclasses.dataclass(frozen=True)
class OwnPath(RobotOptions):
    """Options that make a scenario."""

    file: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="FILE")]
    """FILE.toml, the name of a scenario, or FILE.csv with waypoints."""
    arm: Annotated[str | None, tyro.conf.arg(metavar="ARM")] = None
    """For a CSV file: the name of an arm, or FILE.urdf."""
    speed: Annotated[float | None, tyro.conf.arg(metavar="V"), Bounds(above=0.0)] = None
    """Speed of the tool in [m/s]; needed for a CSV file without times."""
    tool_acceleration: Annotated[float | None, tyro.conf.arg(metavar="A"), Bounds(above=0.0)] = None
    """Acceleration of the tool in [m/s²]; by default it comes to its speed within 0.2 s."""
    corner_radius: Annotated[float | None, tyro.conf.arg(metavar="R")] = None
    """Radius of the arcs that round corners in [m]; a smooth curve through all points if left out."""
    task: Annotated[str | None, tyro.conf.arg(metavar="TASK")] = None
    """Task coordinates: pose, axis (free about the tool's z axis) or position; by default pose where the file has
    orientations."""
    dt: Annotated[float | None, tyro.conf.arg(metavar="T")] = None
    """Control period in [s]: 0.004 by default, or that of the scenario."""
    reserve: Annotated[float, tyro.conf.arg(metavar="SHARE"), Bounds(at_least=0.0, at_most=0.9)] = RESERVE
    """Share of the limits of velocity and acceleration that a retimed motion leaves to the feedback of a real arm."""


_WITH_CSV = (*ROBOT_OPTIONS[:5], "--speed", "--tool-acceleration", "--corner-radius", "--task")
RULES = (
    Rule(("--arm", *_WITH_CSV), lambda given: given.file.endswith(".csv"), "without a CSV file"),
    Rule(ROBOT_OPTIONS[:5], lambda given: (given.arm or "").endswith(".urdf"), "without a URDF file"),
)


def look_at(arm: Arm) -> Arm:
    """The arm with the meshes of its URDF file opened; as it is where the packages for that are not installed."""
    with contextlib.suppress(MissingDependencyError):
        return open_meshes(arm)
    return arm


def describe_bodies(arm: Arm) -> str:
    """The links of an arm that have bodies, what these were made from, and the links that have none."""
    shapes = () if arm.urdf is None else arm.urdf.shapes
    parts = [f"{len(arm.bodies)} on the arm, {len(arm.bodies.pairs)} pairs of which can meet"]
    if meshes := [one for one in shapes if "mesh" in one.source]:
        larger = ", ".join(f"{one.link} {one.covered / one.volume:.2g}" for one in meshes)
        parts.append(f"around meshes, in times the volume of the hull: {larger}")
    if others := [one.link for one in shapes if "mesh" not in one.source]:
        parts.append(f"from shapes of the file: {', '.join(others)}")
    if arm.urdf is not None and arm.urdf.bodyless:
        parts.append(f"stated to be bodyless: {', '.join(arm.urdf.bodyless)}")
    if arm.bodies.unseen:
        parts.append(f"NOT LOOKED AT: {'; '.join(arm.bodies.unseen)}")
    return "; ".join(parts if len(arm.bodies) else ["none", *parts[1:]])


def scenario_of(options: OwnPath) -> Scenario:
    """The scenario that the options mean, over its whole path where they name a CSV file."""
    if options.file.endswith(".csv"):
        return _from_csv(options)
    scenario = scenarios.find(options.file)
    changes: dict[str, Any] = {} if options.dt is None else {"dt": options.dt}
    if options.acceleration or options.jerk:
        changes["arm"] = options.with_limits(scenario.arm)
    if options.jerk:
        changes["jerk_limit"] = None  # that of the arm
    return scenario.replace(**changes) if changes else scenario


def _from_csv(options: OwnPath) -> Scenario:
    if options.arm is None:
        raise InvalidInputError(f"--arm: expected the name of an arm or FILE.urdf with {options.file}, got none.")
    arm, speed = options.robot(options.arm), options.speed
    law: dict[str, Any] = {}
    if speed is not None:
        given = options.tool_acceleration
        law = {"speed": speed, "acceleration": speed / SPEEDING_UP if given is None else given}
    trajectory = from_csv(options.file, corner_radius=options.corner_radius, **law)
    task = options.task or ("pose" if trajectory.has_orientation else "position")
    dt = 0.004 if options.dt is None else options.dt
    return Scenario(pathlib.Path(options.file).stem, arm, tasks.get(task), trajectory, dt=dt)
