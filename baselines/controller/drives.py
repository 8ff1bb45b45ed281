"""Drives of a real arm, and the policy that allows for them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from baselines import registry
from baselines.controller.guards import Guards
from baselines.policy import SolverPolicy
from baselines.spec import PolicySpec, parse_policy
from baselines.wrapper import policies_in
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.scenarios import Scenario
from ikgym.validation import LARGEST, FloatArray, number, shortened, whole_number

#: Drives that are to be identified.
IDENTIFY = "identify"
#: Logarithm of the likelihood ratio from which on identified drives are reported.
EVIDENCE = 10.0
#: The policy that predicts the drives.
PREDICTED = "predicted"
#: The longest delay that is identified, in periods.
LONGEST = 12
#: Its settings for a real arm: lags of up to 40 ms, 5 % of the velocity limits for corrections, calm commands.
SETTINGS: dict[str, Any] = {"longest_delay": LONGEST, "lowest_bandwidth": 4.0, "reserve": 0.05, "overdrive": 1.25}


@dataclasses.dataclass(frozen=True)
class Drives(Frozen):
    """Delay and lag of an arm's drives; none by default.

    Args:
        delay: Control periods from a command to its effect.
        time_constant: T of the first-order lag by which the velocity follows the command, in [s]; None for none.

    Raises:
        InvalidInputError: A number is below 0, or not finite.
    """

    delay: int = 0
    time_constant: float | None = None

    def __post_init__(self) -> None:
        self._settle(delay=whole_number("delay", self.delay, at_least=0))
        if self.time_constant is not None:
            constant = number("time_constant", self.time_constant, at_least=0.0, at_most=LARGEST)
            self._settle(time_constant=constant or None)

    @property
    def perfect(self) -> bool:
        """Whether the velocity is the command at once."""
        return self.delay == 0 and self.time_constant is None

    @property
    def bandwidth(self) -> float | None:
        """The bandwidth 1 / (2π T) of the lag in [Hz]; None where there is none."""
        return None if self.time_constant is None else 1.0 / (2.0 * math.pi * self.time_constant)


def policy_for(
    scenario: Scenario, policy: PolicySpec | SolverPolicy, drives: Drives | str, guards: Guards
) -> SolverPolicy:
    """A policy for an arm with such drives: ``predicted`` around it, unless the drives are perfect.

    The prediction knows the acceleration limits of the guards where the model has none, so that nothing jumps. A policy
    that has ``predicted`` in it is not wrapped again. The arguments are those of :class:`Controller`.

    Raises:
        InvalidInputError: The drives are neither, or told twice; or the policy is none, belongs to another scenario, or
            has no name by which it could be made anew.
        UnknownNameError: There is no such policy, or parameter of it.
    """
    if not isinstance(drives, Drives) and drives != IDENTIFY:
        raise InvalidInputError(f"drives: expected Drives(…) or {IDENTIFY!r}, got {shortened(drives)}.")
    if isinstance(policy, SolverPolicy):
        _check(policy, scenario)
    perfect = isinstance(drives, Drives) and drives.perfect
    if perfect and isinstance(policy, SolverPolicy):
        return policy
    name, parameters = _named(policy)
    inside = any(kind.name == PREDICTED for kind in policies_in((name, parameters)))
    if inside and isinstance(drives, Drives) and not perfect:
        raise InvalidInputError(f"drives: {name} predicts by itself; give it delay and bandwidth, got {drives}.")
    if perfect or inside:
        return registry.make(name, scenario, **parameters)
    model = scenario.model.replace(acceleration_limit=guards.acceleration(scenario.model))
    known: dict[str, Any] = {}
    if isinstance(drives, Drives):
        known = {"delay": drives.delay, "bandwidth": drives.bandwidth, "identify": False}
    options = {"policy": name, "options": parameters, "oldest": guards.age, **SETTINGS, **known}
    return registry.make(PREDICTED, scenario.replace(model=model), **options)


def identified(diagnostics: Mapping[str, FloatArray]) -> Drives | None:
    """The drives that a policy has identified; None while there is no evidence, or it identifies none."""
    if not diagnostics.get("evidence", np.zeros(1))[0] > EVIDENCE:
        return None
    return Drives(round(float(diagnostics["delay"][0])), float(diagnostics["time_constant"][0]))


def _named(policy: PolicySpec | SolverPolicy) -> tuple[str, dict[str, Any]]:
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
