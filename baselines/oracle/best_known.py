"""The best known costs of single episodes: cost ratio = cost / best known cost.

They lie in `baselines/data/best_known.json`, one record a line. A record belongs to the content of its episode, see
:func:`baselines.fingerprints.episode_hash`: where scenario, steps or cost have changed since it is none. The episode is
that of :func:`baselines.oracle.stripped.strip_plant`, so that scenarios in which one arm moves share their records.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import pathlib
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from baselines.files import ResultsError, from_json, locked, read_json, reading, write
from baselines.fingerprints import episode_hash, fingerprint
from baselines.oracle.stripped import strip_plant
from ikgym.scenarios import Scenario

#: Scenario and reset seed.
Key = tuple[str, int]
#: The records that come with the package.
DATA = pathlib.Path(__file__).parents[1] / "data" / "best_known.json"
#: The command that updates them.
UPDATE = "ikgym oracle --update"
#: A best known cost up to here is rounding: an arm that may move where costs do not count can come to zero, and no
#: ratio to that means anything.
MEANINGLESS = 1e-9
#: The share by which a cost must lie below the record to beat it; less may be rounding.
MARGIN = 1e-6
#: How long to wait for another process that writes records, in [s]; it takes some milliseconds.
PATIENCE = 30.0


@dataclasses.dataclass(frozen=True)
class Record:
    """The best known cost of an episode.

    Args:
        scenario: Its name.
        seed: The reset seed.
        cost: The lowest total cost that was found.
        found_by: The method that found it, in words.
        gradient_norm: Norm of the cost's gradient there, in [s/rad] or [s/m].
        spread: Statistics of the starts by name, such as their number and the worst.
        hash: Of the episode, see :func:`baselines.fingerprints.episode_hash`.
    """

    scenario: str
    seed: int
    cost: float
    found_by: str
    gradient_norm: float
    spread: Mapping[str, float]
    hash: str


class _Records(NamedTuple):
    """The records of a file, by scenario and seed, and by the content of their episodes."""

    by_key: Mapping[Key, Record]
    by_hash: Mapping[str, Record]


def lookup(scenario: Scenario, seed: int, arm_seed: int | None = None) -> Record | None:
    """The record of an episode; None where there is none, or it is of another content than the episode now has.

    ``arm_seed`` says which arm moves; that of the seed if left out.
    """
    return _lookup(strip_plant(scenario, seed, arm_seed), seed)


def cost(scenario: Scenario, seed: int, arm_seed: int | None = None) -> float | None:
    """The best known cost that a cost ratio is stated against; None where there is none, or none above 1e-9."""
    return _usable_cost(lookup(scenario, seed, arm_seed))


def costs(scenario: Scenario, seeds: Iterable[int]) -> list[float | None]:
    """:func:`cost` of several episodes."""
    if not scenario.plant.ideal:
        return [cost(scenario, seed) for seed in seeds]
    content = fingerprint(scenario)
    return [_usable_cost(_lookup(content, seed)) for seed in seeds]


def beaten_record(row: Any) -> Record | None:
    """The record that the cost of an evaluation's row lies below, by more than rounding; None where it does not."""
    known = _lookup(row.fingerprint, row.seed)
    if known is None or known.cost <= MEANINGLESS or not row.total_cost < known.cost * (1.0 - MARGIN):
        return None
    return known


def record(records: Iterable[Record], path: pathlib.Path = DATA) -> list[Record]:
    """Keeps records that are better than those that are there, or of another content.

    Args:
        records: The records.
        path: The file; it is replaced in one go, and stays as it is if nothing is better. Several processes may write
            into it: each waits for the others.

    Returns:
        The records that were kept.

    Raises:
        ResultsError: The file is damaged or cannot be written, or a cost is no number of at least 0.
    """
    with locked(path.parent, PATIENCE):  # read and written by one process at a time, or the slower one's would be all
        _read.cache_clear()
        known, kept = dict(_read(path).by_key), _better(records, _read(path).by_key)
        if kept:
            known |= kept
            lines = [json.dumps(_plain(known[key]), ensure_ascii=False, allow_nan=False) for key in sorted(known)]
            write(path, ("[\n" + ",\n".join(lines) + "\n]\n").encode())
            _read.cache_clear()
    return list(kept.values())


def _better(records: Iterable[Record], known: Mapping[Key, Record]) -> dict[Key, Record]:
    """The best of each episode, where it is better than the best known."""
    kept: dict[Key, Record] = {}
    keys = {(one.hash, one.seed): key for key, one in known.items()}
    for new in records:
        if not (math.isfinite(new.cost) and new.cost >= 0.0):
            raise ResultsError(f"{new.scenario}, seed {new.seed}: expected a cost of at least 0, got {new.cost}.")
        # Where the same arm moves in several scenarios, the record keeps the name of the first.
        key = keys.setdefault((new.hash, new.seed), (new.scenario, new.seed))
        old = kept.get(key, known.get(key))
        if old is None or old.hash != new.hash or new.cost < old.cost:
            kept[key] = dataclasses.replace(new, scenario=key[0])
    return kept


def read(path: pathlib.Path = DATA) -> list[Record]:
    """All records of a file, by scenario and seed; none where there is no file.

    Raises:
        ResultsError: It is damaged.
    """
    return list(_read(path).by_key.values())


def _lookup(content: Scenario | str, seed: int) -> Record | None:
    return _read(DATA).by_hash.get(episode_hash(content, seed))


def _usable_cost(known: Record | None) -> float | None:
    return None if known is None or known.cost <= MEANINGLESS else known.cost


@functools.cache
def _read(path: pathlib.Path) -> _Records:
    if not path.exists():
        return _Records({}, {})
    with reading(path, f"Repair it, or compute the costs again with: {UPDATE}"):
        records = [from_json(Record, values) for values in read_json(path)]
    return _Records({(one.scenario, one.seed): one for one in records}, {one.hash: one for one in records})


def _plain(one: Record) -> dict[str, Any]:
    return {**vars(one), "spread": dict(sorted(one.spread.items()))}
