"""Rows as data frames: one line an episode, and one line a policy in a scenario, which is a line of all tables."""

from __future__ import annotations

import collections
import dataclasses
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from baselines import registry
from baselines.evaluation.columns import COLUMNS, CONTACTS, PATH, RANKING, geometric
from baselines.evaluation.metrics import Row, Rows
from baselines.files import canonical, jsonable
from baselines.oracle import best_known
from baselines.registry import parse_policy
from baselines.statistics import geometric_interval, geometric_mean
from ikgym.exceptions import IkgymError, InvalidInputError, printable

#: The quantities by which the episodes of a scenario are compared.
RATIO, TOTAL = "cost ratio", "total cost"
#: Cost ratios where best known costs are missing: relative to the lowest cost in the table.
LOWEST = "lowest in the table"
BEST_KNOWN = "best known"
#: What identifies a policy with its parameters, and a line of a table.
_POLICY = ["policy", "text", "steps"]
_LINE = ["scenario", "label", "text", "steps"]


def summarise(rows: Iterable[Row]) -> pd.DataFrame:
    """One line for each policy with its parameters in each scenario, in the order of their first rows.

    Returns:
        What the columns of tables show, see :data:`baselines.evaluation.table.COLUMNS`: geometric means of costs,
        largest errors, sums of steps and misses. `label` names the policy; `quantity` is what episodes are compared by:
        the cost ratio if all of the scenario are known. Its geometric `mean` over the episodes has an interval from
        `low` to `high`. `times_ideal` is the geometric mean of the cost divided by that of the same seed on an ideal
        plant, with its interval. Of the first row there are `seed`, `fingerprint` and `parameters`.

    Raises:
        InvalidInputError: Two scenarios share a name, or rows belong to different test sets.
    """
    episodes = _label_episodes(rows)
    lines = _lines(episodes, _LINE, episodes.total_cost)
    lines.loc[lines.episodes == 1, ["low", "high"]] = np.nan
    lines = lines.assign(
        quantity=np.where(lines.known, RATIO, TOTAL),
        ratio_low=lines.low.where(lines.known),
        ratio_worst=lines.worst.where(lines.known),
    )
    return lines.merge(_compare_with_ideal(episodes), how="left", on=_LINE)


def escape_names(lines: pd.DataFrame) -> pd.DataFrame:
    """Lines whose names can be shown: control characters and line breaks are escape sequences."""
    return lines.assign(**{key: lines[key].map(printable) for key in ("scenario", "policy", "label")})


def rank(rows: Iterable[Row], policies: Sequence[str] = ()) -> pd.DataFrame:
    """The table of policies: one line for each in each scenario, sorted by cost ratio.

    Agents whose files lie in ``DIR/seed-N/`` are training seeds of one agent, which is called DIR. `cost_ratio` and
    its interval are `relative_to` best known costs; if one of the scenario is missing, to the lowest cost in the table.
    Where a policy has free timing, there are two more columns: the time in which it reached the end of the path, and
    the largest distance from the reference at the progress of the policy, or on the clock of the others. Where a
    scenario has collisions, there are the share of episodes in which the arm was stopped and the smallest clearance.

    Args:
        rows: Results of an evaluation.
        policies: The policies that were evaluated, as text; each is the label of its line. Others are called by their
            name and the parameters that are not at their defaults.

    Raises:
        InvalidInputError: The training seeds of an agent have played different episodes.
    """
    episodes = _label_episodes(rows)
    texts = {text: parse_policy(text) for text in policies if registry.known(text.partition(":")[0])}
    episodes["label"] = [_label(line, texts) or line.label for line in episodes.itertuples()]
    # Costs too small for a ratio count as the smallest allowed.
    lowest = episodes.groupby(["scenario", "seed"]).total_cost.transform("min").clip(lower=best_known.MEANINGLESS)
    lines = _lines(episodes, ["scenario", "label"], episodes.total_cost / lowest)
    more = PATH * bool(lines.free_timing.any()) + CONTACTS * bool(lines.stopped.notna().any())
    lines = lines.assign(
        policy=lines.label,
        relative_to=np.where(lines.known, BEST_KNOWN, LOWEST),
        cost_ratio=lines["mean"],
        place=pd.factorize(lines.scenario)[0],
        path_error_mm=lines.path_error_mm.where(lines.free_timing, lines.position_error_mm),
    )
    return lines.sort_values(["place", "cost_ratio"], ignore_index=True)[[*RANKING, *more]]


def _label_episodes(rows: Iterable[Row]) -> pd.DataFrame:
    """The frame of rows; also the parameters as `text`, a `label` for the policy, and seeds that beat a record."""
    rows = Rows(rows)
    out = rows.frame().assign(
        text=[canonical(row.parameters) for row in rows],
        beaten=[row.seed if best_known.beaten_record(row) else np.nan for row in rows],
        stopped=[np.nan if row.clearance_min is None else float(row.stopped is not None) for row in rows],
        position_error_mm=lambda frame: 1e3 * frame.position_error_max,
        orientation_error_mrad=lambda frame: 1e3 * frame.orientation_error_max,
        path_error_mm=lambda frame: 1e3 * frame.path_position_error,
        clearance_mm=lambda frame: 1e3 * frame.clearance_min,
    )
    for scenario, contents in out.groupby("scenario", sort=False)[["fingerprint", "test_set"]]:
        if len(different := contents.drop_duplicates()) > 1:
            one, other, *_ = different.itertuples(index=False, name=None)
            raise InvalidInputError(
                f"The results of {scenario!r} cannot be put together: fingerprint and test set are {one} and {other}."
            )
    first = out.drop_duplicates(["scenario", *_POLICY])
    named = first.assign(label=labels(first))[["scenario", *_POLICY, "label"]]
    return out.merge(named, on=["scenario", *_POLICY])


#: Columns of a line that no table shows: the column of episodes that each is made of, and how.
_ABOUT: Mapping[str, tuple[str, Any]] = {
    "policy": ("policy", "first"),
    "parameters": ("parameters", "first"),
    "steps": ("steps", "first"),
    "first_seed": ("seed", "first"),
    "machines": ("machine", lambda machines: tuple(map(json.dumps, machines))),
    "beaten": ("beaten", lambda seeds: tuple(seeds.dropna().astype(int))),
    "foresight": ("preview", "max"),
    "seeds": ("text", "nunique"),
    "rows": ("seed", "size"),
    "noisy": ("noise_seed", "any"),
    "stated": ("acceleration_stated", "all"),
    "unknown": ("cost_ratio", lambda ratios: ratios.isna().sum()),
    "known": ("known", "all"),
}


def _lines(episodes: pd.DataFrame, keys: list[str], otherwise: pd.Series) -> pd.DataFrame:
    """One line for each group of episodes: all columns, and the spread of the values over the episodes.

    The values are cost ratios if all of the scenario are `known`, and otherwise the other ones.
    """
    known = episodes.groupby("scenario").cost_ratio.transform(lambda ratios: ratios.notna().all())
    episodes = episodes.assign(known=known, value=episodes.cost_ratio.where(known, otherwise))
    groups = episodes.groupby(keys, sort=False)
    about = {name: how for name, how in _ABOUT.items() if name not in keys}
    shown = {key: (column.of or key, column.how) for key, column in COLUMNS.items() if column.how is not None}
    lines = groups.agg(**about, **shown)
    spread = pd.DataFrame([_spread(label, group) for label, group in groups], index=lines.index)
    lines = lines.join(spread).reset_index()
    return lines.assign(
        reference=[is_reference(policy) for policy in lines.policy],
        free_timing=lines.path_error_mm.notna(),
        lost_percent=100.0 * lines.lost / lines.rows,
        stopped_percent=100.0 * lines.stopped / lines.rows,
    )


def _spread(key: tuple[Any, ...], rows: pd.DataFrame) -> dict[str, Any]:
    """Geometric mean of the values with its interval, and their quantiles.

    The value of an episode is the geometric mean over its noise seeds.
    """
    trained = rows.groupby("text", sort=False)
    by_seed = [some.groupby("seed", sort=False).value.agg(geometric_mean) for _, some in trained]
    seeds = by_seed[0].index
    if any(list(one.index) != list(seeds) for one in by_seed):
        raise InvalidInputError(f"{key[1]}: expected the same episodes of all training seeds.")
    values = np.array(by_seed)
    usable = values.min() > 0.0 and np.isfinite(values).all()
    low, high = geometric_interval(values) if usable else (np.nan, np.nan)
    return {
        "mean": geometric_mean(values),
        "low": low,
        "high": high,
        "median": float(np.median(values)),
        "p90": float(np.percentile(values, 90)),
        "worst": float(values.max()),
        "worst_seed": seeds[int(values.max(axis=0).argmax())],
    }


def _compare_with_ideal(episodes: pd.DataFrame) -> pd.DataFrame:
    """Each line compared with the same policy on an ideal plant, by the seeds of both."""
    keys = [*_LINE, "policy", "fingerprint", "ideal", "seed"]
    means = {"cost": ("total_cost", geometric_mean), "ideal_ratio": ("cost_ratio", geometric)}
    costs = episodes.groupby(keys, sort=False, dropna=False).agg(**means).reset_index()
    ideal = costs.fingerprint == costs.ideal
    plain = costs[ideal].drop_duplicates(["fingerprint", *_POLICY, "seed"], keep="last")
    pairs = costs[~ideal].merge(
        plain, left_on=["ideal", *_POLICY, "seed"], right_on=["fingerprint", *_POLICY, "seed"], suffixes=("", "_plain")
    )
    out = []
    for key, pair in pairs.groupby(_LINE, sort=False):
        if pair[["cost", "cost_plain"]].to_numpy().min() <= 0.0:
            continue
        factors = (pair.cost / pair.cost_plain).to_numpy()
        out.append((*key, geometric(pair.ideal_ratio_plain), geometric_mean(factors), *geometric_interval(factors)))
    return pd.DataFrame(out, columns=[*_LINE, "ideal_cost_ratio", "times_ideal", "times_ideal_low", "times_ideal_high"])


def is_reference(policy: str) -> bool:
    """Whether a policy has privileged information, as far as it is known without importing code of others."""
    try:
        kind = registry.get(policy) if registry.known(policy) else registry.find_imported(policy)
    except IkgymError:
        return False
    return bool(getattr(kind, "reference", False))


def labels(lines: pd.DataFrame) -> list[str]:
    """A label for the policy of each line.

    The name, and the parameters that are not at their defaults; if that leaves two policies of a scenario alike, all
    parameters in which they differ.
    """

    def label(policy: str, parameters: Mapping[str, Any], variants: Sequence[Mapping[str, Any]]) -> str:
        defaults = _defaults(policy)
        parts = [
            f"{name}={f'{value:g}' if isinstance(value, float) else str(value).replace(' ', '')}"
            for name, value in parameters.items()
            if any(variant.get(name) != value for variant in variants) or defaults.get(name, value) != value
        ]
        return policy + (f":{','.join(parts)}" if parts else "")

    alike: dict[tuple[str, str], list[Any]] = collections.defaultdict(list)
    short = [(line.scenario, label(line.policy, line.parameters, ())) for line in lines.itertuples()]
    for name, parameters in zip(short, lines.parameters, strict=True):
        alike[name].append(parameters)
    return [
        label(line.policy, line.parameters, alike[name] if len(alike[name]) > 1 else ())
        for name, line in zip(short, lines.itertuples(), strict=True)
    ]


def _defaults(policy: str) -> dict[str, Any]:
    try:
        fields = dataclasses.fields(registry.get(policy))
    except IkgymError:  # of a policy that is not known here
        return {}
    # None is often a value that the policy works out itself.
    return {f.name: f.default for f in fields if f.default is not dataclasses.MISSING and f.default is not None}


def _label(line: Any, given: Mapping[str, tuple[str, dict[str, Any]]]) -> str | None:
    """The folder of an agent's training seeds, or the policy as text that names most of the parameters; else None."""
    if seed := re.search(r"([^/\\]+)[/\\]seed-\d+[/\\]", str(line.parameters.get("path", ""))):
        return seed[1]
    alike = {
        text: len(parameters)
        for text, (name, parameters) in given.items()
        if name == line.policy and _has(line.parameters, jsonable(parameters))
    }
    return max(alike, key=alike.__getitem__, default=None)


def _has(there: Any, given: Any) -> bool:
    """Whether a value is the given one; of tables, such as the options of an inner policy, the given keys count."""
    if isinstance(there, Mapping) and isinstance(given, Mapping):
        return all(key in there and _has(there[key], value) for key, value in given.items())
    return canonical(there) == canonical(given)
