"""The command ``ikgym identify``: the drives of an arm from a log of its motion."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Annotated

import numpy as np
import tyro

from baselines.cli import shell
from baselines.cli.parsing import Rule
from baselines.files import check_writable_file
from ikgym import arms, files, scenarios
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the command."""

    log: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="LOG")] = None
    """CSV with the columns t, q.JOINT and command.JOINT, or MCAP with joint states and commands."""
    arm: Annotated[str, tyro.conf.arg(metavar="NAME|FILE")] = "panda"
    """The arm: a name, or a scenario file with its arm."""
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Writes the plant (.toml), or with --excite the motion (.csv)."""
    plot: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Draws measured and simulated velocities (.png, .pdf or .svg)."""
    test: Annotated[str | None, tyro.conf.arg(metavar="LOG")] = None
    """A second log, on which the fit is tested."""
    excite: Annotated[str | None, tyro.conf.arg(metavar="NAME|FILE")] = None
    """Writes a motion of this arm to record instead."""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = 30.0
    """Duration of the motion."""
    period: Annotated[float, tyro.conf.arg(metavar="S")] = 0.002
    """Control period of the motion."""
    share: float = 0.4
    """Share of the limits of position, velocity, acceleration and jerk that the motion uses."""


RULES = (
    Rule(("--seconds", "--period", "--share"), lambda given: given.excite is not None, "without --excite"),
    Rule(("--arm", "--plot", "--test"), lambda given: given.excite is None, "with --excite"),
)


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Identifies delay, lag, gain and, where a lag does not suffice, a drive of low order of each joint from a log of an arm
in motion. The file that it writes is a plant for any scenario (plant = "plant.toml") and the drives of a Controller.
Needs SciPy: pip install "ikgym[paths]".

Examples:
  {prog} --excite panda --seconds 30 --out excite.csv
  {prog} log.csv --arm panda --out plant.toml --plot fit.png --test second.csv"""


def _arm(name: str) -> Arm:
    return scenarios.find(name).arm if name.endswith(".toml") else arms.get(name)


def _work(options: Options, _: str) -> None:
    ends = (".csv",) if options.excite is not None else (".toml",)
    for name, file, allowed in (("out", options.out, ends), ("plot", options.plot, (".png", ".pdf", ".svg"))):
        if file is not None and file.suffix not in allowed:
            raise InvalidInputError(f"--{name}: expected a file that ends in {', '.join(allowed)}, got {str(file)!r}.")
        if file is not None:
            check_writable_file(file)
    if options.excite is not None:
        if options.log is not None:
            raise InvalidInputError(f"--excite: expected no log, got {options.log!r}: one or the other.")
        _excite(options)
        return
    if options.log is None:
        raise InvalidInputError("expected a log, or --excite.")
    from baselines.identification.log import read
    from baselines.identification.report import identify

    arm = _arm(options.arm)
    log = read(options.log, arm)
    test = None if options.test is None else read(options.test, arm)
    if test is not None and abs(test.period - log.period) > 0.01 * log.period:
        raise InvalidInputError(
            f"--test: expected a control period of {1e3 * log.period:.4g} ms, got {1e3 * test.period:.4g} ms."
        )
    found = identify(log, arm)
    seconds = log.period * (len(log.q) - 1)
    print(f"{arm.name}: {seconds:.4g} s at a control period of {1e3 * log.period:.4g} ms\n")
    print(shell.align(found.table(test), shell.width()))
    if warnings := found.warnings():
        print("", *(f"warning: {line}" for line in warnings), sep="\n")
    if options.out is not None:
        found.save(options.out)
        print(f"\n{options.out}: a plant for scenarios and a controller at {1e3 * log.period:.4g} ms")
    if options.plot is not None:
        found.plot(options.plot)


def _excite(options: Options) -> None:
    from baselines.identification.excitation import excite

    arm = _arm(str(options.excite))
    if options.out is None:
        raise InvalidInputError("--excite: expected --out FILE.csv.")
    q, command = excite(arm, options.seconds, options.period, options.share)
    names = [*(f"q.{joint}" for joint in arm.joint_names), *(f"command.{joint}" for joint in arm.joint_names)]
    table = np.column_stack([options.period * np.arange(len(q)), q, command])
    lines = [",".join(["t", *names]), *(",".join(f"{value:.9g}" for value in row) for row in table)]
    files.write(options.out, ("\n".join(lines) + "\n").encode())
    used = 100.0 * float((np.abs(command).max(axis=0) / arm.velocity_limit).max())
    print(f"{options.out}: {len(q)} commands, up to {used:.0f} % of the velocity limits, from {arm.name}'s home")


main = shell.Command("identify", Options, manual, _work, RULES)
