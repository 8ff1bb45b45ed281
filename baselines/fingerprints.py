"""Digests of scenarios, episodes and sets of episodes, which identify results."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from baselines.files import canonical, jsonable
from ikgym.arms import Arm, Bodies
from ikgym.kernels import cost as cost_kernels
from ikgym.plant import Plant
from ikgym.scenarios import Scenario

#: Fields of a scenario that change no result: texts, and fields that matter only where bodies may not touch.
APART = {"name", "policy", "source", "jerk_limit", "obstacles", "collisions", "proximity"}
#: Numbers in arrays, mostly of the order of 1, count up to here.
DECIMALS = 12


def fingerprint(scenario: Scenario) -> str:
    """Twelve digits that differ where two scenarios would give different results.

    Covers all fields of a scenario but its name and its source, and the version of the cost,
    :data:`ikgym.kernels.cost.COST_VERSION`. Bodies and obstacles count where touching matters.
    """
    parts = {f.name: getattr(scenario, f.name) for f in dataclasses.fields(scenario) if f.name not in APART}
    if scenario.collides:
        parts["collisions"] = [scenario.arm.bodies, scenario.obstacles]
    if scenario.proximity is not None:
        parts["proximity"] = scenario.proximity
    if np.isfinite(scenario.jerk_limit).any():
        parts["jerk_limit"] = scenario.jerk_limit
    parts |= _of_plant(parts.pop("plant"))
    if scenario.start is None and not scenario.starts_nominally:
        parts["start"] = ["near home", scenario.arm.home]
    return _digest(cost_kernels.COST_VERSION, _canonical(parts))


def arm_fingerprint(arm: Arm) -> str:
    """Twelve digits that differ where two arms move differently; limits, name and home do not count."""
    return _digest("arm", _canonical(list(arm.chain)))


def _of_plant(plant: Plant) -> dict[str, Any]:
    """The parts that are switched on; the digest of bias and noise is as old as the first plants."""
    given = plant.switched_on()
    disturbance = ["Disturbance", {name: getattr(plant, name) for name in ("bias", "noise")}]
    others = {name: value for name, value in given.items() if name not in {"bias", "noise"}}
    return {"disturbance": disturbance, **({"plant": others} if others else {})}


def same(one: object, other: object) -> bool:
    """Whether two frozen objects, such as problems, have the same content, numbers in arrays up to rounding."""
    first, second = ([_canonical(part), _canonical(getattr(part, "bodies", None))] for part in (one, other))
    return canonical(first) == canonical(second)


def episode_hash(scenario: Scenario | str, seed: int) -> str:
    """Twelve digits that identify an episode: its scenario, or the fingerprint of that, and its reset seed."""
    return set_hash(scenario, (seed,))


def set_hash(scenario: Scenario | str, seeds: Iterable[int]) -> str:
    """Twelve digits that identify several episodes, like :func:`episode_hash`."""
    return _digest(scenario if isinstance(scenario, str) else fingerprint(scenario), list(seeds))


def _digest(*parts: Any) -> str:
    return hashlib.sha256(canonical(parts).encode()).hexdigest()[:12]


def _canonical(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: _canonical(getattr(value, f.name)) for f in dataclasses.fields(value) if f.init}
        if isinstance(value, Arm):
            # Home posture and names of joints move nothing, nor do bodies, where touching does not matter. A limit
            # of jerk is the scenario's.
            del fields["home"], fields["joint_names"], fields["bodies"], fields["jerk_limit"]
        if isinstance(value, Bodies):
            del fields["unseen"]  # nothing, wherever touching matters
        if isinstance(value, Arm) and not value.limited:
            # A plant without limits keeps the digest that it had before there were limits.
            del fields["acceleration_limit"]
        return [type(value).__qualname__, fields]
    if isinstance(value, Mapping):
        return {str(k): _canonical(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_canonical(v) for v in value]
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        # Numbers that were calculated, such as turned axes, differ between processors in the last bits.
        value = np.round(value, DECIMALS) + 0.0
    plain = jsonable(value)
    # The default repr() holds an address, which differs from run to run.
    return type(value).__qualname__ if isinstance(plain, str) and " at 0x" in plain else plain
