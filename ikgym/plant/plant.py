"""The plant: deviations of the arm, its drives and its sensors from the data sheet."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Annotated, Any, Self

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.kernels.random_numbers import CUT
from ikgym.plant import checks
from ikgym.plant.arm_kernels import Numbers
from ikgym.plant.checks import Drawn, PerJoint
from ikgym.validation import LARGEST, Bounds, FloatArray, number, per_joint, shorten

#: Fields with one number for all joints, or one a joint.
JOINT_WISE = ("zero", "payload", "backlash", "bias", "noise", "q_noise", "gain")
#: Delays of measurements, in steps.
DELAYS = ("q_delay", "pose_delay")
#: Fields that grow with a severity in proportion: deviations and noises of arm and sensors, and those of the drives.
KNOWLEDGE = ("zero", "link", "axis", "payload", "q_noise", "pose_noise", "pose_rotation_noise", "pose_missing")
DRIVES = ("backlash", "bias", "noise")

Number = Annotated[float, Bounds(at_least=0.0, at_most=LARGEST)]
Steps = Annotated[int, Bounds(at_least=0)]
#: One number for all joints or one a joint, of either sign and of at least 0; and one number or a range.
Signed = Annotated[PerJoint, functools.partial(checks.joint_numbers, signed=True)]
Unsigned = Annotated[PerJoint, checks.joint_numbers]
Ranged = Annotated[Drawn, checks.numbers]


def _arms(name: str, given: Any) -> tuple[Arm, ...]:
    if not isinstance(given, (tuple, list)) or not all(isinstance(one, Arm) for one in given):
        raise InvalidInputError(f"{name}: expected a sequence of arms, got {shorten(given)}.")
    return tuple(given)


@dataclasses.dataclass(frozen=True, repr=False)
class Plant(Frozen):
    """Deviations of kinematics, drives and sensors from the data sheet. All are off by default.

    Noises and missing poses are drawn at each step, all other random values once an episode. Each effect has a separate
    stream of random numbers, so that switching one on shifts no other; normal numbers are cut at 6 standard deviations.
    Policies see the measurements, never the values of :meth:`ikgym.Scenario.drawn_plant`.

    *Kinematics.* Drawn anew each episode, or kept by the reset option `arm_seed`. The arm keeps the limits of
    `scenario.arm`; solvers still use `scenario.model`. Unless the scenario gives a start, an episode begins at the
    posture in which the moving arm has the pose that the arm of the data sheet would begin with.

    *Drives.* Order within a step: delay of the command, velocity limit, acceleration limit, lag, drive of low order,
    gain, bias and noise, backlash, resonance, stop. The backlash lies between drive and joint: the drive turns within
    it before the joint follows. It begins in the middle. Encoders and stops are on the side of the joint. A resonance
    lies behind the backlash: a spring and a damper between encoder and link, which swings freely within a step. Stops
    are on the side of the link. An arm of two joints can have no bandwidths or delays by joint: a pair is a range.

    *Sensors.* The first measurement is made at rest before the episode: it is there from the start, and never missing.
    A camera that measures every E-th step does so at the steps 0, E, 2 E, …; the newest measurement that has arrived is
    observed. Noise belongs to the measurement, and stays with it as long as it is shown.

    *Context.* Some numbers may be ranges (low, high), from which episodes draw uniformly, whole numbers with both ends
    included: the drawn numbers are the context of the episode, which `arm_seed` keeps. The reset's `info` has it, and
    the observation of a learner that is shown it, see :class:`ikgym.rl.Task`.

    Args:
        zero: Standard deviation of the joints' zeros, in [rad] or [m]. A number, or one a joint.
        link: Standard deviation of each of the three parts of each offset from joint to joint, and of the tool point,
            in [m].
        axis: Standard deviation by which each joint's axis is tilted, in each of two directions, in [rad].
        payload: Shift of the joints' zeros from `payload_step` on, in [rad] or [m]. A number, or one a joint.
        payload_step: Steps made when the payload is taken up; one after the end of the episode is never reached.
        arms: Arms one of which moves in place of `scenario.arm`, drawn each episode; their limits are not used. The
            deviations above are added to it.
        calibration: Factor of `zero`, `link` and `axis`. A number, or a range.
        load: Factor of `payload`. A number, or a range.
        bandwidth: Bandwidth f of a first-order velocity loop, in [Hz]: a step closes the share 1 − exp(−2π f Δt) of the
            gap to the commanded velocity. A number, inf for none, one a joint, or a range.
        command_delay: Steps after which a command reaches the drive, which is at rest before. A number or one a
            joint, of which fractions interpolate between two commands; or a range of whole numbers.
        delay_margin: Steps by which commands may come even later. Simulations leave it out; an evaluation plays each
            policy at this margin as well, and warns where it loses the path there.
        drive: A drive of low order: v(k) = a₁ v(k-1) + a₂ v(k-2) + a₃ v(k-3) + b₀ u(k) + … + b₃ u(k-3) is the velocity
            in the step k, u the command as it leaves the lag. The numbers (a₁, a₂, a₃, b₀, b₁, b₂, b₃), or such a row a
            joint; they belong to one Δt. None by default.
        gain: Factor of the velocity. A number, or one a joint.
        resonance: Frequency of the spring between encoder and link, in [Hz]. A number, inf for none, or one a joint.
        resonance_damping: Its damping ratio, above 0 and below 1. A number, or one a joint.
        backlash: Width of the backlash in [rad] or [m]. A number, or one a joint.
        bias: Constant part of the joint velocity, in [rad/s] or [m/s]. A number, or one a joint.
        noise: Bound of a uniform random part of the joint velocity, drawn anew at each step, in [rad/s] or [m/s]. A
            number, or one a joint.
        q_noise: Standard deviation of the measured joint coordinates, in [rad] or [m]. A number, or one a joint.
        pose_noise: Standard deviation of each of the three parts of the measured position, in [m]. A number, or a
            range.
        pose_rotation_noise: Standard deviation of each of the three parts of the rotation vector by which the measured
            orientation is off, in [rad]. A number, or a range. Nothing where the task has no orientation.
        q_delay: Steps by which joint coordinates are observed late.
        pose_delay: Steps by which the pose is observed late.
        pose_every: Steps from one measurement of the pose to the next. A number, or a range.
        pose_missing: Share of the measurements of the pose that are lost.
        from_middle: How far from the middle of their ranges numbers are drawn, from 0 in the middle to 1 at the ends:
            (0, 0.5) is the inner half, (0.5, 1) the rest.

    Raises:
        InvalidInputError: A number is not finite, of the wrong sign or beyond 1e12, a share above 1, a range the wrong
            way round, or the arms are none or do not have joints of the same kinds.
    """

    zero: Unsigned = 0.0
    link: Number = 0.0
    axis: Number = 0.0
    payload: Signed = 0.0
    payload_step: Steps = 0
    arms: Annotated[Sequence[Arm], _arms] = ()
    calibration: Ranged = 1.0
    load: Ranged = 1.0
    bandwidth: Annotated[Drawn | PerJoint, checks.frequency] = math.inf
    command_delay: Annotated[PerJoint | tuple[int, int], checks.delay] = 0
    delay_margin: Number = 0.0
    drive: Annotated[tuple[tuple[float, ...], ...] | tuple[float, ...], checks.coefficients] = ()
    gain: Annotated[PerJoint, checks.positive] = 1.0
    resonance: Annotated[PerJoint, checks.resonances] = math.inf
    resonance_damping: Annotated[PerJoint, functools.partial(checks.positive, below=1.0)] = 0.05
    backlash: Unsigned = 0.0
    bias: Signed = 0.0
    noise: Unsigned = 0.0
    q_noise: Unsigned = 0.0
    pose_noise: Ranged = 0.0
    pose_rotation_noise: Ranged = 0.0
    q_delay: Steps = 0
    pose_delay: Steps = 0
    pose_every: Annotated[int | tuple[int, int], functools.partial(checks.steps, at_least=1)] = 1
    pose_missing: Annotated[float, Bounds(at_least=0.0, at_most=1.0)] = 0.0
    from_middle: Annotated[tuple[float, float], checks.shares] = (0.0, 1.0)

    def __repr__(self) -> str:
        values = {**self.switched_on(), **({"arms": [one.name for one in self.arms]} if self.arms else {})}
        return f"Plant({', '.join(f'{name}={value!r}' for name, value in values.items())})"

    def switched_on(self) -> dict[str, Any]:
        """The fields that differ from their defaults, and their values."""
        values = {field.name: (getattr(self, field.name), field.default) for field in dataclasses.fields(self)}
        return {name: value for name, (value, default) in values.items() if value != default}

    def scaled(self, knowledge: float, drives: float | None = None) -> Self:
        """The plant at other severities: 0 is ideal, 1 the plant itself.

        Args:
            knowledge: Factor of deviations, noises and the share of lost measurements, and, rounded to whole steps, of
                the delays of sensors and of the steps from one measurement to the next.
            drives: Factor of the time constants, delays, backlash, bias and noise of drives, of the period of their
                resonances and of the difference of gains from 1; by default the same.

        Raises:
            InvalidInputError: A severity is below 0 or too large, or the plant has arms or drives of low order, which
                cannot be scaled.
        """
        if self.arms or self.drive:
            raise InvalidInputError(f"scaled: expected a plant without arms or drives of low order, got {self}.")
        known = number("knowledge", knowledge, at_least=0.0, at_most=LARGEST)
        driven = known if drives is None else number("drives", drives, at_least=0.0, at_most=LARGEST)
        changes: dict[str, Any] = {name: scale(getattr(self, name), known) for name in KNOWLEDGE}
        changes |= {name: round(known * getattr(self, name)) for name in DELAYS}
        changes |= {"pose_every": whole(self.pose_every, known, 1), "payload_step": self.payload_step if known else 0}
        changes |= {name: scale(getattr(self, name), driven) for name in DRIVES}
        if driven == 0.0:
            changes |= {"command_delay": 0, "bandwidth": math.inf, "resonance": math.inf, "gain": 1.0}
        else:
            changes |= {name: scale(getattr(self, name), 1.0 / driven) for name in ("bandwidth", "resonance")}
            changes |= {"command_delay": whole(self.command_delay, driven), "gain": scale(self.gain, driven, 1.0)}
        return self.replace(**changes)

    def at_margin(self) -> Self:
        """The plant whose commands come later by `delay_margin`; by whole steps where the delay is drawn."""
        margin = math.ceil(self.delay_margin) if checks.is_range(self.command_delay) else self.delay_margin
        late: Any = np.add(self.command_delay, margin).tolist()
        return self.replace(command_delay=late, delay_margin=0.0)

    def check(self, arm: Arm, steps: int) -> None:
        """Checks that the plant suits an arm and an episode.

        Args:
            arm: The arm of the data sheet.
            steps: Steps of an episode.

        Raises:
            InvalidInputError: Numbers of joints differ, or a delay is longer than the episode.
        """
        by_joint = [name for name in ("bandwidth", "command_delay") if not checks.is_range(getattr(self, name))]
        for name in (*JOINT_WISE, "resonance", "resonance_damping", *by_joint):
            value = np.array(getattr(self, name))
            per_joint(name, np.where(np.isinf(value), 1.0, value), arm.joints)
        if len(self.drive) > 1 and len(self.drive) != arm.joints:
            raise InvalidInputError(f"drive: expected 1 row or {arm.joints}, one a joint, got {len(self.drive)}.")
        for other in self.arms:
            if other.prismatic != arm.prismatic:
                raise InvalidInputError(
                    f"arms: expected {arm.joints} joints of the kinds that arm {arm.name!r} has, got {other.name!r} "
                    f"with prismatic={other.prismatic}."
                )
        for name in ("command_delay", *DELAYS):
            if np.max(getattr(self, name)) > steps:
                raise InvalidInputError(
                    f"{name}: expected at most the {steps} steps of the episode, got {getattr(self, name)}."
                )

    def check_draws_arm(self, name: str) -> None:
        """Checks that the plant draws an arm or drives, which a seed of the arm can keep; takes the scenario's name.

        Raises:
            InvalidInputError: It draws neither.
        """
        if not self.draws_arm:
            raise InvalidInputError(
                f"arm_seed: expected a scenario whose plant draws an arm or its drives, which the seed keeps; that of "
                f"{name!r} draws none: {self}."
            )

    @functools.cached_property
    def ideal(self) -> bool:
        """Whether all effects are off."""
        swings = np.min(self.bandwidth) < math.inf or np.min(self.resonance) < math.inf
        driven = swings or bool(self.drive) or self.longest_command_delay > 0 or np.any(np.not_equal(self.gain, 1.0))
        others = *(name for name in JOINT_WISE if name != "gain"), *KNOWLEDGE
        return not (self.arms or driven or self.late or self._on(*others))

    @property
    def poses_underway(self) -> int:
        """The most measurements of the pose that are on their way at once."""
        return self.pose_delay // int(np.min(self.pose_every)) + 1

    @property
    def late(self) -> bool:
        """Whether observations may belong to an earlier step."""
        return self._on("q_delay", "pose_delay", "pose_missing") or bool(np.max(self.pose_every) > 1)

    @property
    def other_arm(self) -> bool:
        """Whether the moving arm differs from the data sheet, payload aside."""
        return self._on("zero", "link", "axis") or bool(self.arms)

    @functools.cached_property
    def draws_arm(self) -> bool:
        """Whether episodes draw the arm or its drives, which `arm_seed` can keep."""
        return self._on("zero", "link", "axis") or len(self.arms) > 1 or bool(self.context)

    @functools.cached_property
    def context(self) -> tuple[str, ...]:
        """The fields that are ranges, from which episodes draw."""
        ends = {name: self.ends(name) for name in Numbers._fields}
        return tuple(name for name, (low, high) in ends.items() if low < high)

    def ends(self, name: str) -> tuple[float, float]:
        """Both ends of a field that may be a range; where it is none, its largest number twice."""
        value = getattr(self, name)
        return tuple(value) if checks.is_range(value) else (np.max(value), np.max(value))

    @property
    def random(self) -> bool:
        """Whether anything is drawn, once an episode or at each step."""
        return self.draws_arm or self.noisy

    @property
    def noisy(self) -> bool:
        """Whether anything is drawn anew at each step."""
        return self._on("noise", "q_noise", "pose_noise", "pose_rotation_noise", "pose_missing")

    @property
    def longest_command_delay(self) -> int:
        """The most steps after which a command reaches the drive, fractions rounded up."""
        return math.ceil(float(np.max(self.command_delay)))

    def reach(self, arm: Arm, travel: FloatArray) -> float:
        """A radius around the base, in [m], that no drawn arm's tool point leaves.

        Args:
            arm: The arm of the data sheet.
            travel: Largest absolute joint coordinates; only those of prismatic joints count. Shape (n,).
        """
        factor, load = np.max(self.calibration), np.max(self.load)
        shifted = load * np.abs(self.payload) + CUT * factor * np.asarray(self.zero)
        links = CUT * math.sqrt(3.0) * factor * self.link * (arm.joints + 1)
        return float(max(one.reach(travel + shifted) for one in self.arms or (arm,)) + links)

    def _on(self, *names: str) -> bool:
        return any(np.any(getattr(self, name)) for name in names)


def whole(value: Any, factor: float, least: int = 0) -> Any:
    """A whole number, or each of a tuple of them, with its excess over the least one times a factor, rounded.

    Numbers with a fraction stay unrounded, as do those next to them.
    """
    if np.any(np.mod(value, 1.0)):
        return scale(value, factor, least)
    if isinstance(value, tuple):
        return tuple(whole(part, factor, least) for part in value)
    return least + round(factor * (value - least))


def scale(value: Any, factor: float, middle: float = 0.0) -> Any:
    """A number, or a tuple of numbers, with its difference from the middle times a factor."""
    if isinstance(value, tuple):
        return tuple(float(part) for part in middle + factor * (np.array(value) - middle))
    return middle + factor * (value - middle)
