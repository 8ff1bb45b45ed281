"""Optima on disk: a search of minutes is looked up the next time."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import logging
import os
import pathlib
import sys
from collections.abc import Callable, Mapping

import numpy as np

from baselines.files import ResultsError, canonical, from_json, read_arrays, reading, write
from baselines.fingerprints import episode_hash, fingerprint
from baselines.oracle.optimum import Optimum, Search, Start
from baselines.oracle.search import VERSION, polish, search
from baselines.oracle.stripped import ideal, strip_plant
from ikgym import scenarios
from ikgym.kernels.kinematics import add_arm_axis
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, whole_number

logger = logging.getLogger("ikgym")

#: Name of paths found for the episode with an ideal plant.
IDEAL = "optimum with an ideal plant"
#: The environment variable that says where optima are kept.
VARIABLE = "IKGYM_CACHE"


def solve(
    scenario: str | Scenario,
    seed: int = 0,
    how: Search | None = None,
    *,
    arm_seed: int | None = None,
    cached: bool = True,
    tick: Callable[[float], object] | None = None,
    paths: Mapping[str, FloatArray] | None = None,
) -> Optimum:
    """The cheapest joint path of an episode that a search finds: the best known one, certified by nobody.

    Drives and sensors of the plant are left out, see :mod:`baselines.oracle.stripped`. Where the arm is not that of the
    data sheet, the search is that of the episode with an ideal plant, and the path of the same poses is polished on the
    arm that moves.

    Args:
        scenario: The tracking problem, or its name.
        seed: The reset seed.
        how: Search settings.
        arm_seed: Which arm moves; that of the seed if left out.
        cached: Whether to look on disk first, and to keep the result there.
        tick: Called now and then with the share of the work done since the last call.
        paths: Joint coordinates after each step by name, further starts, with which the disk is left alone.
            Shapes (steps, n).

    Returns:
        The same, bit for bit, at every call.

    Raises:
        UnknownNameError: There is no such scenario.
        InvalidInputError: The seed is no whole number of at least 0, or the scenario's plant is not ideal.
    """
    scenario = scenario if isinstance(scenario, Scenario) else scenarios.get(scenario)
    seed, how = whole_number("seed", seed, at_least=0), how or Search()
    on_disk = cached and not paths
    known = read_cached(scenario, seed, how, arm_seed) if on_disk else None
    if known is not None:
        return known
    true, plain = strip_plant(scenario, seed, arm_seed), ideal(scenario, seed)
    if fingerprint(true) == fingerprint(plain):
        optimum = search(true, seed, how, tick, paths)
    else:
        best = solve(plain, seed, how, cached=cached, tick=tick).q
        start = plain.shift_start(best, add_arm_axis(true.arm.chain))  # a third of the Newton steps from `best` itself
        optimum = polish(true, seed, {IDEAL: start, **(paths or {})})
    if on_disk:
        write_cached(optimum, scenario, seed, how, arm_seed)
    return optimum


def read_cached(scenario: Scenario, seed: int, how: Search, arm_seed: int | None = None) -> Optimum | None:
    """The optimum of an episode on disk, see :func:`solve`; None if there is none."""
    known = _read(file_of(scenario, seed, how, arm_seed))
    # The name is not part of the content.
    return None if known is None else known.replace(scenario=scenario.name)


def write_cached(optimum: Optimum, scenario: Scenario, seed: int, how: Search, arm_seed: int | None = None) -> None:
    """Writes an optimum where :func:`read_cached` looks for it; where that cannot be done, a warning says so."""
    try:
        write(file_of(scenario, seed, how, arm_seed), _pack(optimum))
    except ResultsError as e:
        logger.warning("The optimum is not kept: %s", e)


def folder() -> pathlib.Path:
    """Folder of optima: that of the variable IKGYM_CACHE, or the user's cache folder."""
    if given := os.environ.get(VARIABLE):
        return pathlib.Path(given)
    home = pathlib.Path.home()
    if sys.platform == "win32":
        base = pathlib.Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        base = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return base / "ikgym"


def file_of(scenario: Scenario, seed: int, how: Search, arm_seed: int | None = None) -> pathlib.Path:
    """The file of an optimum: named by the content of the episode, the search, and the version of its code.

    Where the arm is not that of the data sheet, the content is that of the episode with an ideal plant, too.
    """
    episodes = [episode_hash(one, seed) for one in (strip_plant(scenario, seed, arm_seed), ideal(scenario, seed))]
    what = canonical([*dict.fromkeys(episodes), dataclasses.asdict(how), VERSION])
    return folder() / "oracle" / f"{hashlib.sha256(what.encode()).hexdigest()[:24]}.npz"


def _pack(optimum: Optimum) -> bytes:
    plain = {f.name: getattr(optimum, f.name) for f in dataclasses.fields(optimum)}
    arrays = {name: plain.pop(name) for name in ("q", "qdot")}
    plain["starts"] = [dataclasses.asdict(start) for start in optimum.starts]
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **arrays, rest=np.array(canonical(plain)))
    return stream.getvalue()


def _read(file: pathlib.Path) -> Optimum | None:
    if not file.exists():
        return None
    try:
        with reading(file):
            content = read_arrays(file)
            rest = json.loads(str(content.pop("rest")))
            rest["starts"] = tuple(from_json(Start, values) for values in rest["starts"])
            return from_json(Optimum, {**rest, **content})
    except ResultsError as e:
        logger.warning("%s It is replaced.", e)
        return None
