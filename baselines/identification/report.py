"""What was identified: the plant, warnings, a table, a file and a plot."""

from __future__ import annotations

import dataclasses
import math
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from baselines.controller.drives import half_period
from baselines.identification.fitting import Joint, Lag, Part, fit_joint, fit_lag, simulate_drive, simulate_lag
from baselines.identification.log import Log
from ikgym import files
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.plant import Plant
from ikgym.plant.checks import COMMANDS, VELOCITIES
from ikgym.plant.identified import IdentifiedPlant
from ikgym.scenarios.files import document
from ikgym.validation import FloatArray

#: Commands look like measured velocities where all latencies are below the first of these, in periods, and either below
#: the second one with such a small error, as a share of the motion, or the motion comes earlier by the fourth one, or
#: it has less than the last one, as a share, of what is fastest in the commands: the rest is noise of a measurement.
SOON, INSTANT, EXACT, EARLY, FOLLOWED = 3.0, 0.3, 0.01, 0.2, 0.5
#: Largest error of a motion that a fit explains, as a share of it.
EXPLAINED = 0.5
#: Gains that come of degrees instead of radians.
DEGREES = 180.0 / math.pi
#: Periods of delay on top of what was found, at which policies are evaluated as well: no model of single joints knows
#: how they pull at each other.
MARGIN = 1.0
#: Differences of gentle and excited parts that count: in periods, and of the gain.
APART = (0.5, 0.05)


@dataclasses.dataclass(frozen=True)
class Identified:
    """Drives that were identified from a log.

    Args:
        arm: The arm.
        log: The log.
        joints: What was found of each joint; one that has not moved has the middle of the others' numbers.
    """

    arm: Arm
    log: Log
    joints: tuple[Joint, ...]

    @property
    def shaped(self) -> bool:
        """Whether drives of low order are needed, for some joint at least."""
        return any(joint.shaped for joint in self.joints)

    @property
    def plant(self) -> IdentifiedPlant:
        """The plant, with the delays and lags that a controller compensates for."""
        lags, period = [joint.lag for joint in self.joints], self.log.period
        constants = np.array([lag.time_constant for lag in lags])
        delays = np.array([lag.delay for lag in lags])
        if self.shaped:
            delay, rows = zip(*(_shape(joint, period) for joint in self.joints), strict=True)
            plant = Plant(command_delay=_numbers(delay), delay_margin=MARGIN, drive=tuple(rows))
        else:
            with np.errstate(divide="ignore"):
                bandwidth = _numbers(1.0 / (2.0 * math.pi * constants))
            gain = _numbers([lag.gain for lag in lags])
            plant = Plant(command_delay=_numbers(delays), delay_margin=MARGIN, bandwidth=bandwidth, gain=gain)
        later = np.maximum(delays - half_period(constants / period), 0.0)
        return IdentifiedPlant(
            self.arm.name, tuple(self.arm.joint_names), period, plant, tuple(later.tolist()), tuple(constants.tolist())
        )

    def simulate(self, joint: int, log: Log | None = None) -> tuple[Part, FloatArray]:
        """The motion of a joint without its slow part, and the simulated one, in [rad] or [m]. Shapes (k,)."""
        part, found = Part(self.log if log is None else log, joint), self.joints[joint]
        if found.moved and self.shaped:
            delay, row = _shape(found, self.log.period)
            return part, simulate_drive(part, int(delay), row)
        return part, simulate_lag(part, found.lag)

    def errors(self, log: Log) -> FloatArray:
        """Rms errors in free run on a log, as shares of the motion. Shape (n,)."""
        played = [self.simulate(j, log) for j in range(len(self.joints))]
        size = [max(float(np.sqrt(np.square(part.y).mean())), 1e-300) for part, _ in played]
        return np.array([np.sqrt(np.square(out - part.y).mean()) for part, out in played]) / size

    def warnings(self) -> list[str]:
        """What the log does not say, one line each."""
        lines = []
        for j, joint in enumerate(self.joints):
            unit = "m/s" if self.arm.prismatic[j] else "rad/s"
            if not joint.moved:
                lines.append(
                    f"{joint.name} moved too little, or not as commanded, to tell: it has the middle of the other "
                    "joints' numbers"
                )
                continue
            if joint.friction:
                lines.append(f"{joint.name}: friction or a dead band takes about {joint.friction:.2g} {unit}")
            if joint.halves:
                (slow, weak), (fast, strong) = joint.halves
                if abs(slow - fast) > APART[0] or abs(weak - strong) > APART[1]:
                    lines.append(
                        f"{joint.name}: gentle and excited parts disagree: latency {slow:.2f} and {fast:.2f} periods, "
                        f"gain {weak:.3f} and {strong:.3f}"
                    )
        return lines

    def table(self, test: Log | None = None) -> list[tuple[str, ...]]:
        """Rows of a table, the heads first: numbers with their standard deviations, and errors in free run."""
        head = ("joint", "delay [periods]", "lag [ms]", "gain", "drive", "error [%]")
        rows: list[tuple[str, ...]] = [(*head, "test [%]") if test is not None else head]
        here, other = self.errors(self.log), None if test is None else self.errors(test)
        for j, joint in enumerate(self.joints):
            lag, (late, slow, factor, _) = joint.lag, joint.lag.deviations
            numbers = (
                f"{lag.delay:.2f} ± {late:.2f}",
                f"{1e3 * lag.time_constant:.3g} ± {1e3 * slow:.2g}",
                f"{lag.gain:.4f} ± {factor:.1g}",
            )
            words = numbers if joint.moved else ("–", "–", "–")
            kind = "low order" if self.shaped and joint.moved else "lag"
            row = (joint.name, *words, kind, f"{100 * here[j]:.3g}")
            rows.append(row if other is None else (*row, f"{100 * other[j]:.3g}"))
        return rows

    def save(self, file: pathlib.Path) -> None:
        """Writes the plant to a TOML file."""
        found = self.plant
        table: dict[str, Any] = {
            "arm": found.arm,
            "joints": list(found.joints),
            "period": found.period,
            "plant": {name: np.array(v) if np.ndim(v) else v for name, v in found.plant.switched_on().items()},
            "drives": {"delay": found.delay, "time_constant": found.time_constant},
        }
        try:
            files.write(file, document(table).encode())
        except OSError as error:
            raise InvalidInputError(f"Cannot write {file}: {error}.") from None

    def plot(self, file: pathlib.Path) -> None:
        """Draws measured and simulated velocities of each joint, in the most excited two seconds."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9.0, 1.7 * len(self.joints)), layout="constrained")
        axes = figure.subplots(len(self.joints), 1, sharex=True, squeeze=False)[:, 0]
        for j, ax in enumerate(axes):
            part, out = self.simulate(j)
            blocks = np.bincount(part.block, np.square(self.log.command[:-1]).sum(axis=1))
            rows = np.flatnonzero(part.block == int(np.argmax(blocks)))
            time = self.log.period * rows
            leak = math.exp(-2.0 * math.pi * 0.3 * self.log.period)
            ax.plot(time, part.command[rows], color="0.7", label="command")
            for values, style, label in ((part.y, "C0-", "measured"), (out, "C3--", "simulated")):
                speed = (values[1:] - leak * values[:-1]) / self.log.period
                ax.plot(time[1:], speed[rows[:-1]], style, linewidth=1.0, label=label)
            ax.set_ylabel(f"{self.joints[j].name}\n[{'m' if self.arm.prismatic[j] else 'rad'}/s]", fontsize=8)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=3, fontsize=8)
        axes[-1].set_xlabel("time [s]")
        figure.savefig(file)


def identify(log: Log, arm: Arm) -> Identified:
    """Identifies the drives of an arm from a log.

    Raises:
        InvalidInputError: No joint moved, joints are swapped, or commands are measured velocities or in degrees; the
            message says what came.
    """
    _check_pairs(log, arm)
    joints = [fit_joint(log, j, name, float(arm.velocity_limit[j])) for j, name in enumerate(arm.joint_names)]
    moved = [joint for joint in joints if joint.moved]
    latency = [joint.lag.delay + joint.lag.time_constant / log.period for joint in moved]
    if max(latency, default=0.0) < SOON:
        early = [_precedes(log, arm, joint) for joint in joints]
        if any(early) and all(one or not joint.moved for one, joint in zip(early, joints, strict=True)):
            raise InvalidInputError(
                "command: expected commands, which come before the motion, got columns that come with it or after it, "
                "or have noise that it lacks: these look like measured velocities, or q like a motion that no arm made."
            )
    if not moved:
        raise InvalidInputError("expected joints that move as they are commanded, got none that moved enough to tell.")
    gain = float(np.median([joint.lag.gain for joint in moved]))
    for factor, what in ((DEGREES, "q"), (1.0 / DEGREES, "command")):
        if abs(gain / factor - 1.0) < 0.2:
            raise InvalidInputError(
                f"{what}: expected [rad] and [rad/s], got gains of {gain:.3g}: degrees and radians."
            )
    middle = [float(np.median([getattr(one.lag, key) for one in moved])) for key in ("delay", "time_constant", "gain")]
    guess = Lag(middle[0], middle[1], middle[2])
    return Identified(arm, log, tuple(one if one.moved else dataclasses.replace(one, lag=guess) for one in joints))


def _precedes(log: Log, arm: Arm, joint: Joint) -> bool:
    """Whether the motion of a joint is its command of the same period, without its noise, or of a later one."""
    part = Part(log, arm.joint_names.index(joint.name))
    size = float(np.sqrt(np.square(part.y).mean()))

    def explains(lag: Lag, share: float) -> bool:
        return float(np.sqrt(np.square(simulate_lag(part, lag) - part.y).mean())) < share * size

    late, lag = fit_lag(part, lowest=-5), joint.lag
    latency, soonest = (one.delay + one.time_constant / log.period for one in (lag, late))
    at_once = joint.moved and latency < INSTANT and explains(lag, EXACT)
    wanted, motion = (np.diff(signal, 4) for signal in (simulate_lag(part, lag), part.y))
    noisy = joint.moved and bool(wanted @ motion < FOLLOWED * (wanted @ wanted))
    return at_once or noisy or (soonest < -EARLY and explains(late, EXPLAINED))


def _check_pairs(log: Log, arm: Arm) -> None:
    """Checks that each joint follows its command, not that of another one."""
    parts = [Part(log, j) for j in range(arm.joints)]
    late = round(0.02 / log.period)
    u = np.stack([part.late(late) for part in parts])
    y = np.stack([part.y for part in parts])
    power = np.sqrt(np.square(u).sum(axis=1)[:, None] * np.square(y).sum(axis=1))
    alike = (u @ y.T) / np.maximum(power, 1e-300)
    for j, name in enumerate(arm.joint_names):
        other = int(np.argmax(alike[:, j]))
        if alike[j, j] < -0.8:
            raise InvalidInputError(f"q.{name}: expected to follow command.{name}, got a motion against it: the sign.")
        if other != j and alike[other, j] > 0.8 and alike[j, j] < 0.5:
            raise InvalidInputError(
                f"q.{name}: expected to follow command.{name}, got a motion that follows command."
                f"{arm.joint_names[other]}: joints are swapped."
            )


def _shape(joint: Joint, period: float) -> tuple[float, tuple[float, ...]]:
    """Whole delay and coefficients of a drive of low order; of the lag where that is all that was found."""
    if joint.moved:
        return float(joint.whole), joint.row
    lag, whole = joint.lag, math.floor(joint.lag.delay)
    share = 1.0 - math.exp(-period / lag.time_constant) if lag.time_constant > 0.0 else 1.0
    row = np.zeros(VELOCITIES + COMMANDS)
    row[0], rest = 1.0 - share, lag.delay - whole
    row[VELOCITIES : VELOCITIES + 2] = share * lag.gain * np.array([1.0 - rest, rest])
    return float(whole), tuple(row.tolist())


def _numbers(values: Sequence[float] | FloatArray) -> Any:
    """Numbers by joint as a plant takes them; two joints have their mean, since a pair would be a range."""
    array = np.asarray(values, dtype=np.float64)
    return float(array.mean()) if len(array) == 2 else tuple(array.tolist())
