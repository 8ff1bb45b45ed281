"""Lines, sections and measurements that say what a test wants them to say."""

import json
import pathlib

import pytest

from baselines.evaluation import test_sets
from baselines.evaluation.pages import sets
from baselines.evaluation.pages.entries import Entry, Training
from baselines.evaluation.pages.measurement import Line, Measurement, Section
from baselines.fingerprints import fingerprint
from baselines.oracle import best_known
from ikgym import scenarios

DOCS = pathlib.Path(__file__).parents[4] / "docs"
TEST_SEEDS = test_sets.SETS[sets.MAIN].seeds
KNOWN = [best_known.cost(scenarios.get(sets.MAIN), seed) for seed in TEST_SEEDS[:2]]


def fake(name="fake", dampings=(1e-2, 2e-2, 3e-2), *, base_policy=None, method="ppo"):
    """An agent whose training seeds are solvers."""
    count = len(dampings)
    training = Training(method, base_policy, tuple(1000 * (k + 1) for k in range(count)), (1.5,) * count)
    return Entry(name, tuple(("dls", {"damping": d}) for d in dampings), tuple(range(count)), training=training)


def line(
    name="dls",
    cost_ratios=((2.0, 8.0),),
    *,
    preview=1,
    seeds=(),
    error=0.0005,
    settings=(),
    training=None,
    times=(10.0, 20.0, 30.0),
    known=KNOWN,
):
    """A line with these cost ratios in the first episodes of the main test set."""
    cost = tuple(tuple(r * k for r, k in zip(row, known, strict=True)) for row in cost_ratios)
    errors = tuple(tuple(error for _ in row) for row in cost_ratios)
    lost = sum(map(len, errors)) if error > 0.05 else 0
    return Line(name, dict(settings), preview, seeds, cost, errors, lost, 1, *times, training)


def learned(name, cost_ratios, *, base_policy=None, **others):
    count = len(cost_ratios)
    training = Training("ppo", base_policy, (1_000_000,) * count, (12.0,) * count)
    return line(name, cost_ratios, seeds=tuple(range(count)), preview=240, training=training, **others)


def point(spec, cost, p50=10.0, p99=20.0, *, lost=0, seeds=()):
    """A line with these costs, seed by seed, and times."""
    size = len(cost) // max(len(seeds), 1)
    costs = tuple(tuple(cost[k : k + size]) for k in range(0, len(cost), size))
    return Line(spec, {}, 1, seeds, costs, None, lost, 1, p50, p99, 30.0, None)


def a_section(*lines, seeds=TEST_SEEDS[:2], name=sets.MAIN):
    return Section(name, fingerprint(sets.get(name)), None, seeds, lines)


def a_measurement(*sections):
    return Measurement("a command", "2000-01-01", {"cpu": "a machine"}, sections)


def write_runs(folder, seeds, *, first=0, method="ppo", base_policy=None):
    for seed in range(first, first + seeds):
        run = {
            "method": method,
            "training": {"steps": 100 + seed, "core_minutes": 0.5},
            "processing": {} if base_policy is None else {"base_policy": base_policy},
        }
        (folder / f"seed-{seed}").mkdir(parents=True)
        (folder / f"seed-{seed}" / "run.json").write_text(json.dumps(run))


def complete(measurement, share=1):
    """Skips a test while what lies in docs/ was measured on a part of the episodes, which the page says itself."""
    first, wanted = measurement.sections[0], test_sets.SETS[sets.MAIN]
    if (first.name, first.seeds) != (wanted.name, wanted.seeds[: int(share * wanted.episodes)]):
        there = f"{len(first.seeds)} episodes of {first.name}"
        pytest.skip(f"measured on {there} so far: measure anew with python -m baselines.leaderboard --out …")
