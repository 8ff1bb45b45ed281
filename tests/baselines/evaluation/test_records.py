"""Comparisons of policies: rankings from rows, CSV and Markdown, intervals and plots."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from baselines.evaluate import evaluate
from baselines.evaluation.metrics import Row
from baselines.evaluation.plots import comparison
from baselines.evaluation.plots.style import png
from baselines.evaluation.summary import BEST_KNOWN, LOWEST, rank
from baselines.evaluation.table import from_csv, markdown, to_csv
from baselines.statistics import geometric_interval
from ikgym.exceptions import InvalidInputError


@pytest.fixture(scope="module")
def row():
    (one,) = evaluate("varga7-fast", "dls", steps=3)
    return one


def episodes(row, cost_ratios, **changes):
    """Rows with these cost ratios, one per seed."""
    return [
        dataclasses.replace(row, seed=seed, cost_ratio=ratio, total_cost=100.0 * ratio, **changes)
        for seed, ratio in enumerate(cost_ratios)
    ]


def agent(row, seed, cost_ratios):
    path = {"path": f"runs/apg/seed-{seed}/agent.safetensors"}
    return episodes(row, cost_ratios, policy="agent", parameters=path)


class TestRanking:
    def test_one_line_per_policy_sorted_by_cost_ratio(self, row):
        rows = [*episodes(row, (4.0, 9.0)), *episodes(row, (1.0, 4.0), policy="qp", parameters={}, time_p99_us=7.0)]
        first, second = rank(rows).itertuples()
        assert (first.policy, first.cost_ratio, first.time_p99_us) == ("qp", pytest.approx(2.0), 7.0)
        assert (second.cost_ratio, second.worst, second.p90) == (pytest.approx(6.0), 9.0, 8.5)
        assert (second.episodes, second.seeds, second.relative_to) == (2, 1, BEST_KNOWN)
        assert (second.low, second.high) == geometric_interval((4.0, 9.0))

    def test_training_seeds_share_a_line(self, row):
        (line,) = rank([*agent(row, 0, (1.0, 2.0)), *agent(row, 1, (2.0, 4.0))]).itertuples()
        assert (line.policy, line.seeds, line.episodes) == ("apg", 2, 2)
        assert line.cost_ratio == pytest.approx(2.0)
        with pytest.raises(InvalidInputError, match="apg: expected the same episodes"):
            rank([*agent(row, 0, (1.0, 2.0)), *agent(row, 1, (2.0,))])

    def test_without_best_known_costs_relative_to_the_lowest(self, row):
        rows = [*episodes(row, (2.0, 8.0)), *episodes(row, (4.0, 2.0), policy="qp", parameters={})]
        lines = rank([dataclasses.replace(one, cost_ratio=None) for one in rows])
        assert lines.relative_to.tolist() == [LOWEST] * 2
        assert lines.cost_ratio.tolist() == pytest.approx([np.sqrt(2.0), 2.0])

    def test_labels_are_the_policies_as_given_with_the_options_of_inner_ones(self, row):
        given = ["rhc:horizon=3", "rhc:horizon=3,iterations=1", "smoothed:options={'horizon': 3}"]
        given.append("smoothed:options={'horizon': 9}")
        plain, short = ({"horizon": 3, "iterations": iterations} for iterations in (None, 1))
        inner = [{"options": {"horizon": horizon, "iterations": 1}} for horizon in (3, 9)]
        rows = []
        for cost, parameters in enumerate((plain, short, *inner), 2):
            policy = "smoothed" if "options" in parameters else "rhc"
            rows += episodes(row, (float(cost),), policy=policy, parameters=parameters)
        assert rank(rows, given).policy.tolist() == given


class TestFiles:
    LINES = (
        {"policy": "a|b", "n": 1200, "cost_ratio": 1.23456789, "low": 1.0, "high": 2.0, "lost_percent": 0.5},
        {"policy": "c", "n": 2, "cost_ratio": 1e9, "low": None, "high": None, "lost_percent": 100.0},
    )

    def test_csv_and_back(self):
        lines = from_csv(to_csv(self.LINES))
        assert lines[0]["cost_ratio"] == "1.23457"
        assert lines[1]["low"] == ""
        assert markdown(lines) == markdown(self.LINES) == markdown(pd.DataFrame(self.LINES))
        assert to_csv(pd.DataFrame(self.LINES)) == to_csv(self.LINES)

    def test_markdown(self):
        assert markdown(self.LINES).splitlines() == [
            "| policy | n | cost ratio | 95 % | lost [%] |",
            "| :-- | --: | --: | --: | --: |",
            "| `a\\|b` | 1,200 | 1.235 | 1.000 … 2.000 | 0.5 |",
            "| `c` | 2 | 1.000e9 | – | 100 |",
        ]

        assert markdown(self.LINES, ["n", "policy"]).startswith("| n | policy |")
        with pytest.raises(InvalidInputError, match="expected some of policy, n"):
            markdown(self.LINES, ["m"])


def test_rows_are_a_frame():
    rows = evaluate("zhang3-helix", ["dls", "moore_penrose"], steps=3)
    frame = rows.frame()
    assert list(frame)[:-1] == [field.name for field in dataclasses.fields(Row)]
    assert frame.total_cost.tolist() == [row.total_cost for row in rows]
    assert frame.orientation_error_max.isna().all()
    assert frame.lost.tolist() == [row.lost for row in rows]


def line(policy, ratio, p99, **changes):
    interval = {"low": 0.9 * ratio, "high": 1.1 * ratio}
    about = {"policy": policy, "scenario": "s", "foresight": 1, "episodes": 2, "lost_percent": 0.0}
    return about | {"cost_ratio": ratio, **interval, "time_p99_us": p99} | changes


def test_the_front_is_what_no_other_beats():
    lines = [
        *(line("fast", 3.0, 10.0), line("beaten", 4.0, 20.0), line("good", 1.1, 50.0), line("untimed", 1.0, None)),
        line("diverged", float("nan"), 1.0),
        line("fewer episodes", 1.0, 5.0, episodes=1),
    ]
    front, *_ = comparison.cost_time(lines, "title").axes[0].lines
    assert front.get_xdata().tolist() == [10.0, 50.0]


def shown(axis):
    """Ticks in sight."""
    low, high = axis.get_view_interval()
    return [tick for tick in axis.get_ticklocs() if low <= tick <= high]


def test_plots_show_every_line():
    lines = [line("a", 3.0, 10.0), line("b", 1.1, 50.0, foresight=9)]
    drawn = comparison.cost_time(lines, r"$\title$")
    png(drawn)  # refuses a formula that is none
    assert [text.get_text() for text in drawn.legends[0].get_texts()] == ["a", "b"]
    close = comparison.cost_time([line("a", 1.30, 11.0), line("b", 1.32, 12.0)], "title").axes[0]
    assert min(len(shown(axis)) for axis in (close.xaxis, close.yaxis)) >= 2
    exact = [line(name, 1.0 + 1e-6 * k, 25.0 + k, low=None, high=None) for name, k in (("a", 0), ("b", 185))]
    assert len(shown(comparison.cost_time(exact, "title").axes[0].yaxis)) >= 3
    cells = [line("a", 2.0, None, knowledge=k, drives=d) for k in (0, 1) for d in (0, 1)]
    texts = [text.get_text() for text in comparison.severity_map(cells).axes[0].texts]
    assert texts == ["2.000"] * 4
