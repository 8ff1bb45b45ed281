"""The page as Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from matplotlib.figure import Figure

from baselines.evaluation import test_sets
from baselines.evaluation.metrics import LOST_ORIENTATION, LOST_POSITION
from baselines.evaluation.pages.markdown import IMAGES, share, table
from baselines.evaluation.pages.robustness import pictures
from baselines.evaluation.pages.robustness.measured import Effect, Entry, Measured
from baselines.evaluation.report import NOTHING, number
from baselines.evaluation.results import slug
from baselines.oracle.stripped import NOTE
from ikgym.scenarios import imperfect

INTRODUCTION = f"""\
What policies are worth on an arm that is not the one in the data sheet, whose drives lag and whose camera is slow and
noisy: the [scenarios of imperfect plants](scenarios.md). Written by `ikgym robustness`; everything below is worked out
from what was measured, which lies in [robustness.json](robustness.json).

- **Cost ratio** is the total cost divided by the [best known cost](evaluation.md#best-known-costs) of the episode,
  {NOTE}: what the very arm that moves could do if somebody knew it, drove it ideally and saw the whole path.
  Nobody comes to 1 who has to learn the arm first.
- **`told`** is no contender: it tells another policy the arm that moves, and delay and lag of its drives. Lines marked
  with * have privileged information.
- **95 %** are intervals of geometric means over the episodes (percentile bootstrap, 9,999 resamples). Where there is
  noise each episode is played with three noise seeds, the same for all policies, and counts once, with their mean.
- **Ideal** is the cost ratio of the same policy with an ideal plant on the same seeds, **× ideal** the geometric mean
  of its cost divided by that with the same seed.
- **Lost** is the share of runs in which the arm was at some time more than {1e3 * LOST_POSITION:g} mm away from where
  it should have been, or turned away by more than {LOST_ORIENTATION:g} rad.
- Test sets of imperfect plants have 64 episodes (65 where one arm plays five of them in a row): they are long, are
  played with three noise seeds, and each needs a best known cost on an arm of its own.
"""
MAP = """\
Over two severities of `{scenario}`: from left to right what nobody knows of the arm (calibration, payload, camera)
grows from nothing to its worst, from bottom to top what the drives do (lag and delay). {episodes} test episodes of each
policy in each cell, with one noise seed: a map, and no ranking of policies that are close together. Colours are of the
cost ratio; numbers below it are the share of lost episodes."""
BEST = "The best policy of each cell is the one that loses the fewest episodes, and among those the cheapest."


#: The cost ratios that a policy without privileged information is to stay below, losing no episode.
GOALS = {"panda-measured": 1.15, "panda-camera": 1.4, "panda-bus": 1.25, "panda-field": 1.5}
REACHED = """\
The best policy without privileged information of those that have played the most episodes, beside `told`. A goal is
reached where its cost ratio is not above it, and no episode is lost; of sets that it has not played to their ends that
is said so far. `told` may have played fewer episodes than the policy: each table says how many."""
EFFECTS = """\
What parts of the plant of `{scenario}` cost, each with all else ideal: geometric means of the cost divided by that of
the same policy on the ideal plant with the same seed, with intervals of 95 % over {episodes} test episodes, and in
brackets the share of lost ones."""


def page(measured: Measured) -> str:
    """The page."""
    out = ["# Robustness", "", INTRODUCTION, *_legend(measured), *_missing(measured)]
    if goals := _goals(measured.entries):
        out += ["## Goals", "", REACHED, "", *goals, ""]
    for name in dict.fromkeys(one.scenario for one in measured.entries):
        some = [one for one in measured.entries if one.scenario == name]
        out += [f"## `{name}`", "", f"{_numbers(some)} test episodes{_noise(name)}.", "", *_table(some), ""]
    if measured.effects:
        text = EFFECTS.format(scenario=measured.scenario, episodes=measured.episodes)
        out += ["## What each effect costs alone", "", text, "", *_effects(measured), ""]
    if measured.cells:
        out += ["## Map", "", MAP.format(scenario=measured.scenario, episodes=measured.episodes), ""]
        out += [f"![Best policy of each cell]({_file(None)})", "", BEST, ""]
        for policy in _policies(measured):
            out += [f"![Cost ratios of {policy}]({_file(policy)})", ""]
    machine = ", ".join(f"{name} {value}" for name, value in measured.machine.items())
    out += ["## Conditions", "", f"- command: `{measured.command}`", f"- date: {measured.date}"]
    return "\n".join([*out, f"- machine: {machine}"]) + "\n"


def drawn(measured: Measured) -> Iterator[tuple[str, Figure]]:
    """The pictures, and where they lie, seen from the page."""
    if measured.cells:
        yield _file(None), pictures.best([cell for cell in measured.cells if cell.policy in _contenders(measured)])
    for policy in _policies(measured):
        yield _file(policy), pictures.one(policy, [cell for cell in measured.cells if cell.policy == policy])


def _goals(entries: Sequence[Entry]) -> list[str]:
    """What was to be reached, and what was; nothing where none of it has been played."""
    lines = [line for name in GOALS if (line := _goal(name, [one for one in entries if one.scenario == name]))]
    titles = ["test set", "policy", "episodes", "cost ratio", "95 %", "lost", "told", "goal", "reached"]
    return table(titles, lines, text=(0, 1)) if lines else []


def _goal(name: str, entries: Sequence[Entry]) -> list[str]:
    known = [one for one in entries if one.cost_ratio is not None and not one.reference]
    if not known:
        return []
    most = max(one.episodes for one in known)
    best = min((one for one in known if one.episodes == most), key=lambda one: (one.lost > 0.0, one.cost_ratio))
    told = min((one.cost_ratio for one in entries if one.reference and one.cost_ratio is not None), default=None)
    reached = "yes" if best.cost_ratio is not None and best.cost_ratio <= GOALS[name] and not best.lost else "no"
    reached += "" if most >= _all_of(name) else ", so far"
    about = [name, f"`{best.policy}`", str(best.episodes), number(best.cost_ratio), _between(best.interval)]
    return [*about, share(best.lost), number(told), number(GOALS[name]), reached]


def _table(entries: Sequence[Entry]) -> list[str]:
    """From the lowest cost ratio on."""
    ordered = sorted(entries, key=lambda one: (one.cost_ratio is None, one.cost_ratio))
    lines = [
        [
            f"`{one.policy}`{' *' * one.reference}",
            str(one.episodes),
            number(one.cost_ratio),
            _between(one.interval),
            share(one.lost),
            number(one.ideal),
            number(one.paired),
            _between(one.paired_interval),
        ]
        for one in ordered
    ]
    return table(["policy", "episodes", "cost ratio", "95 %", "lost", "ideal", "× ideal", "95 %"], lines, text=(0,))


def _numbers(entries: Sequence[Entry]) -> str:
    """How many episodes the policies have played, from the most on."""
    return " or ".join(map(str, sorted({one.episodes for one in entries}, reverse=True)))


def _legend(measured: Measured) -> list[str]:
    """What labels stand for."""
    own = {label: policy for label, policy in measured.policies.items() if label != policy}
    return ["What labels stand for:", "", *(f"- `{label}` is `{policy}`" for label, policy in own.items()), ""] * bool(
        own
    )


def _missing(measured: Measured) -> list[str]:
    """What of the test sets has not been measured, and how it would be."""
    played = {one.scenario for one in measured.entries}
    some = {one.scenario: None for one in measured.entries if one.episodes < _all_of(one.scenario)}
    bounds = {one.scenario: None for one in measured.entries if one.cost_ratio is None}
    sentences = {
        "Not measured yet: {}; `--sets` plays them.": [name for name in imperfect.SCENARIOS if name not in played],
        "Of these not all policies have played more than the first episodes, as their tables say: {}.": list(some),
        "Best known costs are missing of {}: there are no cost ratios, only pairs.": list(bounds),
    }
    return [text.format(", ".join(names)) + "\n" for text, names in sentences.items() if names]


def _all_of(name: str) -> int:
    return test_sets.SETS[name].episodes if name in test_sets.SETS else 0


def _effects(measured: Measured) -> list[str]:
    """A policy a line, an effect a column."""
    names = list(dict.fromkeys(one.name for one in measured.effects))
    found = {(one.policy, one.name): one for one in measured.effects}
    policies = dict.fromkeys(one.policy for one in measured.effects)
    lines = [
        [f"`{policy}`{' *' * (policy in measured.references)}", *(_effect(found[policy, name]) for name in names)]
        for policy in policies
    ]
    return table(["policy", *names], lines, text=(0,))


def _effect(one: Effect) -> str:
    lost = f" ({share(one.lost)})" if one.lost else ""
    return f"{number(one.paired)} [{_between((one.low, one.high))}]{lost}"


def _contenders(measured: Measured) -> list[str]:
    """Policies of the map without privileged information; all of them where there are no others."""
    return [policy for policy in _policies(measured) if policy not in measured.references] or _policies(measured)


def _policies(measured: Measured) -> list[str]:
    return list(dict.fromkeys(cell.policy for cell in measured.cells))


def _noise(name: str) -> str:
    known = test_sets.SETS.get(name)
    several = f", {known.noise_seeds} noise seeds each" if known and known.noise_seeds > 1 else ""
    return several + (f", {known.sequence} in a row by one arm" if known and known.sequence > 1 else "")


def _between(ends: tuple[float, float] | None) -> str:
    return NOTHING if ends is None else f"{number(ends[0])} … {number(ends[1])}"


def _file(policy: str | None) -> str:
    """Where the picture of a policy lies, or that of the best ones."""
    return (IMAGES / f"robustness-{'best' if policy is None else slug(policy)}.png").as_posix()
