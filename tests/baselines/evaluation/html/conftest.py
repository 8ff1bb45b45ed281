"""A folder of results with its report, made once for all tests of the page."""

import dataclasses
import datetime
import json

import numpy as np
import pytest

from baselines.evaluate import evaluate
from baselines.evaluation.html import PAGE, page
from baselines.evaluation.results import read_rows
from tests.baselines.evaluation.html.reading import results_of
from tests.limited import limited

#: What a scenario must not be able to do to a page.
NASTY = '<script>alert(1)</script> & "co\'"'
STEPS, EPISODES = 450, 3


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Two scenarios, the first of which has limits that are reached, and one policy that none else has."""
    out = tmp_path_factory.mktemp("report")
    scenarios = [limited(steps=STEPS, name=NASTY, dt=0.001), limited(steps=20, name="short")]
    policies = ["dls", "moore_penrose", "dls:damping=0.05", "follow_nominal"]
    evaluate(scenarios, policies, episodes=EPISODES, out=out, plots=False)
    return out


@pytest.fixture(scope="session")
def full_folder(folder, tmp_path_factory):
    """256 episodes of each of 25 policies, as large as real ones: no two rows share a number or a count."""
    out = tmp_path_factory.mktemp("full")
    first = read_rows(folder / "results.json")[0]
    log = results_of(folder).series_file(first).read_bytes()
    rng = np.random.default_rng(0)
    rows = [_drawn(first, policy, seed, rng) for policy in range(25) for seed in range(256)]
    (out / "results.json").write_text(json.dumps([row.to_json() for row in rows]), encoding="utf-8")
    results = results_of(out)
    for row in rows[::256]:
        file = results.series_file(row)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(log)
    date = datetime.datetime(2026, 1, 2, 3, 4, tzinfo=datetime.UTC)
    (out / PAGE).write_bytes(page(results, command="x", date=date))
    return out


def nasty_policy(number):
    """The name of a policy that would like to be an element, the end of one, or a place in a template of Plotly."""
    return f"<b>{number}</b><img src=x onerror=alert()></script>%{{y}}"


def _drawn(row, policy, seed, rng):
    """A row with other numbers."""
    numbers = {field.name: getattr(row, field.name) for field in dataclasses.fields(row)}
    drawn = {name: float(rng.lognormal()) for name, value in numbers.items() if isinstance(value, float)}
    counts = {status: int(rng.integers(1, 1000)) for status in ("converged", "unknown")}
    return dataclasses.replace(
        row, policy=nasty_policy(policy), seed=seed, cost_ratio=float(rng.lognormal()), status_counts=counts, **drawn
    )
