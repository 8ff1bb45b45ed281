"""What of the arm that moves differs from the arm in the data sheet: its kinematics, its drives, its sensors."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.random_numbers import CUT
from ikgym.plant import checks, severity
from ikgym.plant.checks import Drawn, PerJoint
from ikgym.validation import LARGEST, FloatArray, Frozen, number, per_joint, shortened, whole_number

#: What is one number for all joints, or one a joint; and which of them may be negative.
JOINT_WISE = ("zero", "payload", "backlash", "bias", "noise", "q_noise")
SIGNED = ("payload", "bias")
#: What is one number of at least 0.
SCALARS = ("link", "axis", "pose_noise", "pose_rotation_noise")
#: Steps by which something comes late, as far as they are not drawn.
DELAYS = ("q_delay", "pose_delay")


@dataclasses.dataclass(frozen=True, repr=False)
class Plant(Frozen):
    """The plant as it is: kinematics, drives and sensors that are not those of the data sheet. All off by default.

    What is drawn is drawn once an episode, but for the noises and for missing poses, which are drawn at each step. Each
    effect has a stream of random numbers of its own, so that switching one on shifts no other; normal numbers are cut
    at 6 standard deviations. Of the values that :meth:`ikgym.Scenario.drawn_plant` gives, policies see what sensors
    show, and nothing else.

    *Kinematics.* Drawn anew each episode, or kept by the reset option `arm_seed`. The arm keeps the limits of
    `scenario.arm`, and solvers go on to know `scenario.model`. Where the scenario gives no start, the arm is jogged to
    it: episodes begin where the arm that moves has the pose that the one in the data sheet would begin with.

    *Drives.* In a step, in this order: delay of the command, velocity limit, acceleration limit, lag, bias and noise,
    backlash, stop. The backlash lies between drive and joint: the drive turns within it before the joint follows. It
    begins in the middle. Encoders and stops are on the joint's side of it.

    *Sensors.* The first measurement is made at rest before the episode: it is there from the start, and never missing.
    A camera that measures every E-th step does so at the steps 0, E, 2 E, …; what is observed is the newest measurement
    that has arrived. Noise belongs to the measurement, and stays with it as long as it is shown.

    Args:
        zero: Standard deviation of the joints' zeros, in [rad] or [m]. A number, or one a joint.
        link: Standard deviation of each of the three parts of each offset from joint to joint, and of the tool point,
            in [m].
        axis: Standard deviation by which each joint's axis is tilted, in each of two directions, in [rad].
        payload: What is added to the joints' zeros from `payload_step` on, in [rad] or [m]. A number, or one a joint.
        payload_step: Steps made when the payload is taken up; one after the end of the episode is never reached.
        arms: Arms one of which moves in place of `scenario.arm`, drawn each episode; their limits are not used. What
            the standard deviations above say comes on top.
        bandwidth: Bandwidth f of a first-order velocity loop, in [Hz]: of what is missing to the velocity that is asked
            for, a step makes up for 1 − exp(−2π f Δt). A number, inf for none, or a range (low, high) that episodes
            draw from evenly.
        command_delay: Steps after which a command reaches the drive, which is told to stand before. A whole number, or
            a range (low, high) that episodes draw from evenly, both ends included.
        backlash: Width of the backlash in [rad] or [m]. A number, or one a joint.
        bias: A constant that is added to the joint velocity, in [rad/s] or [m/s]. A number, or one a joint.
        noise: Bound of a uniform random part of the joint velocity, drawn anew at each step, in [rad/s] or [m/s]. A
            number, or one a joint.
        q_noise: Standard deviation of the measured joint coordinates, in [rad] or [m]. A number, or one a joint.
        pose_noise: Standard deviation of each of the three parts of the measured position, in [m].
        pose_rotation_noise: Standard deviation of each of the three parts of the rotation vector by which the measured
            orientation is off, in [rad]. Nothing where the task has no orientation.
        q_delay: Steps by which joint coordinates are observed late.
        pose_delay: Steps by which the pose is observed late.
        pose_every: Steps from one measurement of the pose to the next.
        pose_missing: Share of the measurements of the pose that are lost.

    Raises:
        InvalidInputError: A number is not finite, of the wrong sign or beyond 1e12, a share above 1, a range the wrong
            way round, or the arms are none or do not have joints of the same kinds.
    """

    zero: PerJoint = 0.0
    link: float = 0.0
    axis: float = 0.0
    payload: PerJoint = 0.0
    payload_step: int = 0
    arms: Sequence[Arm] = ()
    bandwidth: Drawn = math.inf
    command_delay: int | tuple[int, int] = 0
    backlash: PerJoint = 0.0
    bias: PerJoint = 0.0
    noise: PerJoint = 0.0
    q_noise: PerJoint = 0.0
    pose_noise: float = 0.0
    pose_rotation_noise: float = 0.0
    q_delay: int = 0
    pose_delay: int = 0
    pose_every: int = 1
    pose_missing: float = 0.0

    def __post_init__(self) -> None:
        settled: dict[str, Any] = {
            **{name: checks.joint_numbers(name, getattr(self, name), signed=name in SIGNED) for name in JOINT_WISE},
            **{name: number(name, getattr(self, name), at_least=0.0, at_most=LARGEST) for name in SCALARS},
            **{name: whole_number(name, getattr(self, name), at_least=0) for name in ("payload_step", *DELAYS)},
            "bandwidth": checks.frequency("bandwidth", self.bandwidth),
            "command_delay": checks.steps("command_delay", self.command_delay),
            "pose_every": whole_number("pose_every", self.pose_every, at_least=1),
            "pose_missing": checks.share("pose_missing", self.pose_missing),
            "arms": _arms(self.arms),
        }
        for name, value in settled.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        values = {**self.switched_on(), **({"arms": [one.name for one in self.arms]} if self.arms else {})}
        return f"Plant({', '.join(f'{name}={value!r}' for name, value in values.items())})"

    def switched_on(self) -> dict[str, Any]:
        """The fields that are not as they are by default, and their values."""
        values = {field.name: (getattr(self, field.name), field.default) for field in dataclasses.fields(self)}
        return {name: value for name, (value, default) in values.items() if value != default}

    def scaled(self, knowledge: float, drives: float | None = None) -> Self:
        """The plant at other severities: 0 is ideal, 1 the plant itself.

        Args:
            knowledge: Of calibration, payload and sensors: deviations, noises and the share of lost measurements are
                so many times as large, and delays and the steps from one measurement to the next so many times as long,
                rounded to whole steps.
            drives: Of the drives: time constants, delays, backlash, bias and noise; as the knowledge if left out.

        Raises:
            InvalidInputError: A severity is below 0 or too large, or the plant has arms of its own, which are no matter
                of degree.
        """
        if self.arms:
            raise InvalidInputError(f"scaled: expected a plant without arms of its own, got {self}.")
        known = number("knowledge", knowledge, at_least=0.0, at_most=LARGEST)
        driven = known if drives is None else number("drives", drives, at_least=0.0, at_most=LARGEST)
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return self.replace(**severity.knowledge(values, known), **severity.drives(values, driven))

    def check(self, arm: Arm, steps: int) -> None:
        """Insists that the plant suits an arm and an episode.

        Args:
            arm: The arm of the data sheet.
            steps: Steps of an episode.

        Raises:
            InvalidInputError: Numbers of joints differ, or something comes later than the episode ends.
        """
        for name in JOINT_WISE:
            per_joint(name, getattr(self, name), arm.joints)
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
        """Insists that there is something that a seed of the arm could keep.

        Args:
            name: Of the scenario.

        Raises:
            InvalidInputError: Neither the arm nor its drives are drawn.
        """
        if not self.draws_arm:
            raise InvalidInputError(
                f"arm_seed: expected a scenario whose plant draws an arm or its drives, which the seed keeps; that of "
                f"{name!r} draws none: {self}."
            )

    @property
    def ideal(self) -> bool:
        """Whether nothing is switched on."""
        return not (self.moves_otherwise or self.measures_otherwise)

    @property
    def moves_otherwise(self) -> bool:
        """Whether the arm or its drives are not those of the data sheet."""
        return self._perturbs_arm or self._on("backlash", "bias", "noise") or self._driven_late

    @property
    def measures_otherwise(self) -> bool:
        """Whether sensors are noisy, slow or late."""
        return self._on("q_noise", "pose_noise", "pose_rotation_noise") or self.late

    @property
    def late(self) -> bool:
        """Whether what is observed may be of an earlier step."""
        return self._on("q_delay", "pose_delay", "pose_missing") or self.pose_every > 1

    @property
    def other_arm(self) -> bool:
        """Whether the arm that moves is not that of the data sheet, a payload aside."""
        return self._on("zero", "link", "axis") or bool(self.arms)

    @property
    def draws_arm(self) -> bool:
        """Whether episodes draw the arm or its drives, which `arm_seed` can keep."""
        ranges = (one for one in (self.bandwidth, self.command_delay) if isinstance(one, tuple))
        return self._on("zero", "link", "axis") or len(self.arms) > 1 or any(low < high for low, high in ranges)

    @property
    def random(self) -> bool:
        """Whether anything is drawn, of an episode or of a step."""
        return self.draws_arm or self.noisy

    @property
    def noisy(self) -> bool:
        """Whether anything is drawn anew at each step."""
        return self._on("noise", "q_noise", "pose_noise", "pose_rotation_noise", "pose_missing")

    @property
    def longest_command_delay(self) -> int:
        """The most steps after which a command reaches the drive."""
        return int(np.max(self.command_delay))

    def reach(self, arm: Arm, travel: FloatArray) -> float:
        """A radius around the base that the tool point of no drawn arm leaves, in [m].

        Args:
            arm: The arm of the data sheet.
            travel: Largest absolute joint coordinates; only those of prismatic joints count. Shape (n,).
        """
        shifted = np.abs(self.payload) + CUT * np.asarray(self.zero)
        links = CUT * math.sqrt(3.0) * self.link * (arm.joints + 1)
        return float(max(one.reach(travel + shifted) for one in self.arms or (arm,)) + links)

    def _on(self, *names: str) -> bool:
        return any(np.any(getattr(self, name)) for name in names)

    @property
    def _perturbs_arm(self) -> bool:
        return self.other_arm or self._on("payload")

    @property
    def _driven_late(self) -> bool:
        return self.bandwidth != math.inf or self.longest_command_delay > 0


def _arms(given: Any) -> tuple[Arm, ...]:
    if not isinstance(given, (tuple, list)) or not all(isinstance(one, Arm) for one in given):
        raise InvalidInputError(f"arms: expected a sequence of arms, got {shortened(given)}.")
    return tuple(given)
