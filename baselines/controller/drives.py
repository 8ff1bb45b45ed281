"""Drives of a real arm, and the policy that allows for them."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from baselines import registry
from baselines.controller.guards import Guards
from baselines.policy import SolverPolicy
from baselines.registry import PolicySpec, parse_policy
from baselines.solvers.adaptive.drives import KNOWN
from baselines.wrapper import policies_in
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.plant.checks import PerJoint, joint_numbers
from ikgym.plant.identified import IdentifiedPlant
from ikgym.scenarios import Scenario
from ikgym.validation import LARGEST, FloatArray, per_joint, shorten

#: Drives that are to be identified.
IDENTIFY = "identify"
#: The policy that predicts the drives.
PREDICTED = "predicted"
#: The longest delay that is identified, in periods, and the longest time constant, in [s].
LONGEST, SLOWEST = 12, 0.04
#: Settings of the policy for a real arm: this range (a discretised lag adds up to half a period of delay), 5 % of the
#: velocity limits for corrections, and calm commands.
SETTINGS: dict[str, Any] = {
    "longest_delay": LONGEST + 1,
    "lowest_bandwidth": 1.0 / (2.0 * math.pi * SLOWEST),
    "reserve": 0.05,
    "overdrive": 1.25,
}


@dataclasses.dataclass(frozen=True)
class Drives(Frozen):
    """Delay and lag of an arm's drives; none by default.

    Args:
        delay: Control periods from a command to its effect, fractions included. A number, or one a joint.
        time_constant: T of the first-order lag by which the velocity follows the command, in [s]; 0 or None for none. A
            number, or one a joint.

    Raises:
        InvalidInputError: A number is below 0, or not finite.
    """

    delay: PerJoint = 0.0
    time_constant: PerJoint | None = None

    def __post_init__(self) -> None:
        self._settle(delay=joint_numbers("delay", self.delay))
        if self.time_constant is not None:
            constant = joint_numbers("time_constant", self.time_constant)
            self._settle(time_constant=constant if np.any(constant) else None)

    @property
    def perfect(self) -> bool:
        """Whether the velocity is the command at once."""
        return not np.any(self.delay) and self.time_constant is None

    def parameters(self, joints: int, dt: float) -> dict[str, Any]:
        """Parameters of `predicted`, whose lag is discretised; the time by which that comes too early is a delay.

        Args:
            joints: n.
            dt: Δt in [s].

        Raises:
            InvalidInputError: The arm has another number of joints.
        """
        delay = per_joint("delay", self.delay, joints)
        constant = per_joint("time_constant", self.time_constant or 0.0, joints)
        with np.errstate(divide="ignore"):
            bandwidth = np.minimum(1.0 / (2.0 * math.pi * constant), LARGEST)
        later = delay + half_period(constant / dt)
        return {"delay": tuple(later.tolist()), "bandwidth": tuple(bandwidth.tolist())}


@dataclasses.dataclass(frozen=True)
class IdentifiedDrives(Drives):
    """Identified drives, joint by joint.

    Args:
        delay: See :class:`Drives`; the mean of the other joints where a joint has not moved.
        time_constant: See ``delay``.
        moved: Whether a joint has moved enough to be identified. n booleans.
        at_least: Whether delay or time constant are at the end of the identified range: they may be longer. n booleans.
    """

    moved: tuple[bool, ...] = ()
    at_least: tuple[bool, ...] = ()

    def __str__(self) -> str:
        """One line a joint."""
        lines, n = [], len(self.moved)
        delay, constant = per_joint("delay", self.delay, n), per_joint("", self.time_constant or 0.0, n)
        for j in range(n):
            least = "at least " if self.at_least[j] else ""
            guessed = "" if self.moved[j] else ", the mean of the others: it has not moved"
            numbers = f"{delay[j]:.2f} periods of delay, {1e3 * constant[j]:.3g} ms of lag"
            lines.append(f"joint {j + 1}: {least}{numbers}{guessed}")
        return "\n".join(lines)


def drives_of(drives: Drives | str | os.PathLike[str], scenario: Scenario) -> Drives | str:
    """The drives in a file that ``ikgym identify`` wrote, where drives are named by one.

    Raises:
        InvalidInputError: The file cannot be read, or belongs to another arm or control period.
    """
    if isinstance(drives, Drives) or drives == IDENTIFY or not str(drives).endswith(".toml"):
        return drives  # type: ignore[return-value]  # refused later if it is neither
    found = IdentifiedPlant.load(drives)
    found.plant_for(scenario.arm, scenario.dt)
    return Drives(found.delay, found.time_constant)


def half_period(constant: FloatArray) -> FloatArray:
    """By how many periods a lag in continuous time is later than a discretised one.

    With dv/dt = (u - v) / T the velocity rises during a period. The discretised v(k) = v(k-1) + (1 - exp(-Δt/T))
    (u(k) - v(k-1)) jumps at its beginning. The joint is later by T/Δt - 1/(exp(Δt/T) - 1) periods: 0 without a lag,
    half a period with a long one.

    Args:
        constant: T/Δt. Shape (n,).
    """
    with np.errstate(divide="ignore", over="ignore"):
        periods = constant - 1.0 / np.expm1(1.0 / constant)
    return np.clip(periods, 0.0, 0.5)  # what rounding leaves of very long lags


def policy_for(
    scenario: Scenario, policy: PolicySpec | SolverPolicy, drives: Drives | str, guards: Guards
) -> SolverPolicy:
    """A policy for an arm with such drives: ``predicted`` around it, unless the drives are perfect.

    The prediction knows the acceleration limits of the guards where the model has none, so that nothing jumps. A policy
    that has ``predicted`` in it is not wrapped again. The arguments are those of :class:`Controller`.

    Raises:
        InvalidInputError: The drives are neither, or given twice; or the policy is none, or is of another scenario, or
            has no name by which it could be made anew.
        UnknownNameError: There is no such policy, or parameter of it.
    """
    if not isinstance(drives, Drives) and drives != IDENTIFY:
        raise InvalidInputError(
            f"drives: expected Drives(…), {IDENTIFY!r} or a file that ends in .toml, got {shorten(drives)}."
        )
    if isinstance(policy, SolverPolicy):
        _check(policy, scenario)
    perfect = isinstance(drives, Drives) and drives.perfect
    if perfect and isinstance(policy, SolverPolicy):
        return policy
    name, parameters = _name_and_parameters(policy)
    inside = any(kind.name == PREDICTED for kind in policies_in((name, parameters)))
    if inside and isinstance(drives, Drives) and not perfect:
        raise InvalidInputError(f"drives: {name} predicts by itself; give it delay and bandwidth, got {drives}.")
    if perfect or inside:
        return registry.make(name, scenario, **parameters)
    model = scenario.model.replace(acceleration_limit=guards.acceleration(scenario.model))
    known: dict[str, Any] = {}
    if isinstance(drives, Drives):
        known = {**drives.parameters(model.joints, scenario.dt), "identify": False}
    options = {"policy": name, "options": parameters, "oldest": guards.age, **SETTINGS, **known}
    return registry.make(PREDICTED, scenario.replace(model=model), **options)


def identified_drives(diagnostics: Mapping[str, FloatArray], dt: float) -> IdentifiedDrives | None:
    """The drives that a policy has identified; None while there is no evidence, or it identifies none.

    Args:
        diagnostics: Those of the policy.
        dt: Δt in [s].
    """
    moved = diagnostics.get("doubt", np.full((1, 1), np.inf))[0] <= KNOWN
    if not moved.any():
        return None
    later, constant = diagnostics["delay"][0], diagnostics["time_constant"][0]
    delay = np.maximum(later - half_period(constant / dt), 0.0)
    at_least = (later >= LONGEST + 1) | (constant >= 0.999 * SLOWEST)
    return IdentifiedDrives(*(tuple(array.tolist()) for array in (delay, constant, moved, at_least)))


def _name_and_parameters(policy: PolicySpec | SolverPolicy) -> tuple[str, dict[str, Any]]:
    if not isinstance(policy, SolverPolicy):
        return parse_policy(policy)
    name = registry.name_of(type(policy))
    if not registry.known(name):
        raise InvalidInputError(
            f"policy: expected one with a name, see baselines.register, so that it can be made for the drives; got "
            f"{name}. For perfect drives give drives=Drives()."
        )
    return name, policy.parameters


def _check(policy: SolverPolicy, scenario: Scenario) -> None:
    ours = scenario.model.joints, scenario.task.name, scenario.dt
    its = policy.problem.model.joints, policy.problem.task.name, policy.problem.dt
    if ours != its:
        raise InvalidInputError(
            f"policy: expected one for {ours[0]} joints, the task {ours[1]!r} and Δt = {ours[2]:g} s, as scenario "
            f"{scenario.name!r} has them, got one for {its[0]}, {its[1]!r} and {its[2]:g} s."
        )
