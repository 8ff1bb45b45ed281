"""The command ``ikgym path``: whether an arm can drive a path, from which start, and how fast."""

from __future__ import annotations

import dataclasses
import pathlib
import textwrap
from typing import Annotated, Any, Literal

import numpy as np
import tyro

from baselines.cli import shell
from baselines.cli.own_path import RULES, OwnPath, describe_bodies, look_at, scenario_of
from baselines.controller.guards import Guards
from baselines.files import check_writable_file
from baselines.paths import Branch, Retimed, Survey, survey
from baselines.paths.late import describe_drives, play_late, states_drives
from baselines.paths.motion import OTHERS, PREFERRED
from baselines.paths.planning import PLAYER, Plan, plan
from baselines.paths.retiming import find_retimed, refusal
from baselines.paths.speeds import fastest, speed_limit
from baselines.paths.survey import REACHED, Contact, describe_reserve, follows
from ikgym import tasks
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.files import read_user_toml
from ikgym.scenarios import Scenario, files
from ikgym.validation import BoolArray, FloatArray, add_location, known_names, whole_number

#: Most branches in the table, and the number of the column of clearances.
SHOWN, CLEARANCE = 8, 5
#: A motion that uses more than this share of a limit is played on drives that lag, also where it is not retimed.
HARD = 0.7


@dataclasses.dataclass(frozen=True)
class Options(OwnPath):
    """Options of the command."""

    retime: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="OUT.toml")] = None
    """Writes the scenario that can be driven: the best start, slower where a limit binds."""
    fastest: bool = False
    """Times the path as fast as the limits allow, not only as fast as asked."""
    branch: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Takes the start in this line of the table."""
    obstacles: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """Obstacles of another scenario file, or of a file with nothing else, instead of those of the scenario."""
    bodies: Literal["on", "off"] | None = None
    """Whether bodies count. They do where there are obstacles, and with a CSV file if the arm has bodies."""


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Says whether an arm can drive a path, from which start and how fast: qp plays it from several postures at the first
pose, and toppra finds the shortest time in which the limits hold, less a reserve for feedback. Where the arm has
bodies, it keeps clear of itself and of obstacles. Where qp follows from no posture, a joint motion is planned along the
whole path. Needs pip install "ikgym[paths]".

Examples:
  {prog} weld.toml --retime weld-retimed.toml
  {prog} weld.csv --arm arm.urdf --tip tool0 --speed 0.2 --acceleration 5
  {prog} weld.csv --arm panda --speed 0.2 --obstacles cell.toml"""


def _work(options: Options, _: str) -> None:
    if options.retime is not None and options.retime.suffix != ".toml":
        raise InvalidInputError(f"--retime: expected a file that ends in .toml, got {str(options.retime)!r}.")
    if options.retime is not None:
        check_writable_file(options.retime)
    every = found = survey(_scenario(options), reserve=options.reserve)
    if options.branch is not None:
        row = whole_number("--branch", options.branch, at_least=1, at_most=len(every.branches)) - 1
        found = dataclasses.replace(every, branches=every.branches[row : row + 1])
    driven = find_retimed(found, fastest=options.fastest)
    close = driven is not None and follows(driven.motion)
    planned = None if close else plan(found, fastest=options.fastest)
    driven = (planned and planned.motion) or driven
    head, verdict = ([_fold(line) for line in lines] for lines in (_head(found), _verdict(found, driven, planned)))
    print("\n".join([*head, "", _table(every), "", *verdict]))
    if options.retime is not None:
        if driven is None:
            raise InvalidInputError(f"--retime: the path cannot be driven, {options.retime} is not written.")
        driven.scenario.save(options.retime)
        print(f"\n{options.retime}: {driven.scenario.steps} steps of {driven.scenario.dt:g} s")


def _fold(line: str) -> str:
    """A line in the width of the terminal; a start, which is copied into files, stays in one."""
    if line.startswith("start = "):
        return line
    indent = "  " if line.startswith("  ") else ""
    return textwrap.fill(line, shell.width(), break_on_hyphens=False, subsequent_indent=indent)


def _scenario(options: Options) -> Scenario:
    """The scenario that the options mean, with its obstacles."""
    scenario, changes = scenario_of(options), dict[str, Any]()
    if options.obstacles is not None:
        changes = _obstacles(options.obstacles)
    if options.bodies is not None:
        changes["collisions"] = options.bodies == "on"
    elif options.file.endswith(".csv") and not changes.get("obstacles"):
        changes["arm"] = arm = look_at(scenario.arm)
        changes["collisions"] = len(arm.bodies) > 0 and not arm.bodies.unseen
    return scenario.replace(**changes) if changes else scenario


def _obstacles(file: pathlib.Path) -> dict[str, Any]:
    """The obstacles of a file, as a field of a scenario."""
    table = read_user_toml(file)
    with add_location("", file):
        known_names("key", table, [field.name for field in dataclasses.fields(Scenario)])
        if "obstacles" not in table:
            raise InvalidInputError("obstacles: expected tables [[obstacles]], got no such key.")
        return files.arguments(Scenario, {"obstacles": table["obstacles"]}, file.parent, like=True)


def _head(found: Survey) -> list[str]:
    scenario = found.scenario
    title = f"{scenario.name}: {scenario.arm.name}, task {scenario.task.name}, {found.duration:.3g} s"
    return [title, "", *_tool(found)]


def _tool(found: Survey) -> list[str]:
    """The tool at the first pose, and its speeds; what is not known of the arm."""
    scenario = found.scenario
    frame, (linear, angular) = scenario.frames(scenario.trajectory, 1)[0], fastest(scenario)
    begins = f"  begins at ({shell.numbers(frame[-3:])}) m"
    if len(frame) == 12:
        begins += f", the tool's z axis along ({shell.numbers(frame[2:9:3])})"
    limit = speed_limit(scenario.trajectory)
    asked = "" if limit is None else f", {limit[0]:.3g} m/s was asked, but {limit[1]}"
    turning = f", the tool turns by {angular:.3g} rad/s" if angular > 1e-6 else ""
    lines = [begins, f"  fastest {linear:.3g} m/s{asked}{turning}"]
    if _find_unstated(scenario.arm).any():
        checked = "those of Controller are kept" if found.reserve else "velocities alone are checked"
        lines.append(f"  acceleration limits are not stated (see --acceleration): {checked}")
    if len(scenario.arm.bodies) or scenario.arm.bodies.unseen:
        count = "bodies" if scenario.collides else "bodies, which do not count here"
        lines.append(f"  {count}: {describe_bodies(scenario.arm)}")
    if scenario.cut_off:
        lines.append(f"  the episode ends {scenario.cut_off:.3g} s before the path: give it more steps, or none")
    return lines


def _table(found: Survey) -> str:
    head = ("", "reaches", "velocity", "acceleration", "to a stop", "clearance", "shortest", "start [rad or m]")
    rows = [head, *(_row(i, branch, found.scenario) for i, branch in enumerate(found.branches[:SHOWN], 1))]
    if all(branch.contact is None for branch in found.branches):
        rows = [(*row[:CLEARANCE], *row[CLEARANCE + 1 :]) for row in rows]
    return shell.align(rows, shell.width())


def _row(number: int, branch: Branch, scenario: Scenario) -> tuple[str, ...]:
    arm = scenario.arm
    far, turned = branch.position_error, branch.orientation_error
    missed = f"{100 * branch.reached:.0f} %, {_small(far, 'm') if far > REACHED[0] else _small(turned, 'rad')}"
    joint, room = int(np.argmin(branch.room)), float(branch.room.min())
    return (
        str(number),
        "all" if branch.reached == 1.0 else missed,
        _share(arm, branch.velocity / scenario.largest_qdot) if branch.whole else "–",
        _share(arm, branch.acceleration / arm.acceleration_limit) if branch.whole else "–",
        f"{room:.2f} {_unit(arm, joint)} {arm.joint_names[joint]}" if np.isfinite(room) else "–",
        _clearance(branch.contact),
        "–" if branch.shortest is None else f"{branch.shortest.duration:.3g} s",
        " ".join(f"{q + 0.0:.1f}" for q in np.round(branch.start, 1)),
    )


def _clearance(contact: Contact | None) -> str:
    if contact is None:
        return "–"
    pair = ", ".join(contact.pair)
    touch = f"touch at {contact.time:.3g} s: {pair}"
    return touch if contact.touched else f"{_small(contact.clearance, 'm')}: {pair}"


def _small(value: float, unit: str) -> str:
    """A number in thousandths of its unit."""
    return f"{1e3 * value:.3g} m{unit}"


def _share(arm: Arm, shares: FloatArray) -> str:
    """The joint that uses the largest share of its limit."""
    joint = int(np.argmax(shares))
    return f"{100 * shares[joint]:.0f} % {arm.joint_names[joint]}" if shares[joint] > 0.0 else "–"


def _unit(arm: Arm, joint: int) -> str:
    return "m" if arm.prismatic[joint] else "rad"


def _verdict(found: Survey, driven: Retimed | None, planned: Plan | None) -> list[str]:
    if driven is None:
        return [f"It cannot be driven: {refusal(found)}{_describe_end(found, planned)}", *_free_about_z(found)]
    motion, start = driven.motion, shell.numbers(np.round(driven.motion.q[0, 0], 4))
    how = f"{driven.solver} follows within {_small(motion.position_error.max(), 'm')}"
    if found.scenario.task.has_orientation:
        how += f" and {_small(motion.orientation_error.max(), 'rad')}"
    if not follows(motion):
        how += f" (no closer, nor do {' and '.join(OTHERS)}: a stop or a singularity is near)"
    elif driven.solver == PLAYER:
        how += " (a joint motion planned along the whole path: no solver follows it from any start branch)"
    elif driven.solver in OTHERS:
        how += f" (where {PREFERRED} does not: a stop or a singularity is near)"
    elif driven.solver != PREFERRED:
        how += " (its slow joints are spared, which takes less time)"
    hold = "all limits hold" if not _find_unstated(found.scenario.arm).any() else f"velocities hold, {_peak(driven)}"
    used = f", at most {100 * driven.share:.0f} % of them are used" if found.reserve and driven.share <= 1.0 else ""
    lines = [f"{_when(found, driven)}: {how}, {hold}{used}.", f"start = [{start}]"]
    if driven.solver != PREFERRED:
        where = f"Controller(…, {driven.solver!r})"
        if driven.solver == PLAYER:
            where = "Scenario.nominal_joint_path() gives its joint coordinates"
        lines.append(f"Play it with {driven.solver}: evaluate --policies, {where}.")
    return lines if driven.solver == PLAYER else [*lines, *_warnings(found, driven)]


def _warnings(found: Survey, driven: Retimed) -> list[str]:
    """Why a control loop may stop the motion on drives that lag."""
    arm, lines = driven.scenario.arm, []
    excess = np.where(_find_unstated(arm), _peaks(driven) / Guards().acceleration(arm), 0.0)
    joint = int(np.argmax(excess))
    if excess[joint] > 1.0:
        allowed = f"{Guards().acceleration(arm)[joint]:.3g} {_unit(arm, joint)}/s² at {arm.joint_names[joint]}"
        lines.append(f"Controller allows {allowed}, and may lose the path: state limits with --acceleration.")
    stated = states_drives(driven.scenario.plant)
    if stated or driven.duration != found.duration or driven.share > HARD:
        loop = play_late(driven.scenario, driven.solver)
        ends = f"follows within {_small(loop.error, 'm')}."
        if loop.stopped is not None:
            ends = (
                f"stops after {loop.time:.3g} s ({loop.stopped.name}): begin with a slower motion, or keep more in "
                "reserve (--reserve)."
            )
        others = "" if stated else " Slower drives were not tried."
        lines.append(f"On {describe_drives(driven.scenario.plant)}, Controller {ends}{others}")
    return lines


def _describe_end(found: Survey, planned: Plan | None) -> str:
    """Where the search along the whole path has ended."""
    if planned is None:
        return ""
    if planned.reached < found.duration:
        return f" A search for joint motions along the whole path gets as far as {planned.reached:.3g} s."
    return " A joint motion along the whole path exists, but none that keeps the limits was found."


def _when(found: Survey, driven: Retimed) -> str:
    """Whether the path can be driven in the time that was asked for, and in which one it can."""
    can = "It can be driven as it is"
    if driven.duration == found.duration:
        return can
    speed = f"in {driven.duration:.3g} s, at up to {fastest(driven.scenario)[0]:.3g} m/s"
    if any(found.as_asked(REACHED, solver) for solver in {PREFERRED, driven.solver} - {PLAYER}):
        return f"{can}, and {speed}"
    if driven.duration < found.duration:
        return f"It cannot be driven at the speeds that were asked for, but at others, {speed}"
    return f"It cannot be driven in {found.duration:.3g} s, but {speed}{describe_reserve(found.reserve)}"


def _free_about_z(found: Survey) -> list[str]:
    """Whether the path can be driven if the tool may turn about its z axis; nothing where it cannot, or may already."""
    if found.scenario.task.error_size < 6:
        return []
    try:
        free = survey(found.scenario.replace(task=tasks.get("axis"), initial_pose=None), reserve=found.reserve)
    except InvalidInputError:
        return []
    driven = find_retimed(free)
    if driven is None:
        return []
    return [
        f'It can, in {driven.duration:.3g} s, if the tool may turn about its z axis: --task axis, or task = "axis".'
    ]


def _find_unstated(arm: Arm) -> BoolArray:
    """Joints without a limit of acceleration. Shape (n,)."""
    unstated: BoolArray = ~np.isfinite(arm.acceleration_limit)
    return unstated


def _peak(driven: Retimed) -> str:
    """The largest acceleration of a joint without a limit."""
    arm, peaks = driven.scenario.arm, _peaks(driven)
    joint = int(np.argmax(np.where(_find_unstated(arm), peaks, 0.0)))
    return f"accelerations come to {peaks[joint]:.3g} {_unit(arm, joint)}/s² at {arm.joint_names[joint]}"


def _peaks(driven: Retimed) -> FloatArray:
    """The largest accelerations in [rad/s²] or [m/s²]. Shape (n,)."""
    motion = driven.motion
    steps = np.diff(motion.q[:, 0], axis=0, prepend=motion.q[:1, 0])  # from rest
    peaks: FloatArray = np.abs(np.diff(steps, axis=0)).max(axis=0) / motion.times[1] ** 2
    return peaks


main = shell.Command("path", Options, manual, _work, RULES)
