"""The page as text: nothing from elsewhere, names as text, and the numbers of the results."""

import dataclasses
import datetime
import json
import math
import re

import pytest

from baselines.cli.commands.evaluate import main
from baselines.evaluate import evaluate
from baselines.evaluation.columns import REPORT, columns
from baselines.evaluation.html.page import embed, page
from baselines.evaluation.jobs import Options
from baselines.evaluation.metrics import Skipped, describe
from baselines.evaluation.results import PAGE, Results, read_rows
from baselines.evaluation.summary import summarise
from baselines.evaluation.table import LAST, html
from baselines.files import ResultsError
from baselines.statistics import geometric_interval
from tests.baselines.evaluation.html.conftest import EPISODES, NASTY, STEPS
from tests.baselines.evaluation.test_report import BASE as ROW

BASE = dataclasses.replace(ROW, machine=describe())
DATE = datetime.datetime(2026, 1, 2, 3, 4, tzinfo=datetime.UTC)


def results_of(folder):
    return Results([], Options(out=folder, resume=True))


def data_of(text):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)[1])


@pytest.fixture(scope="module")
def text(folder):
    return (folder / PAGE).read_text(encoding="utf-8")


def cells(entry):
    """Sort value and text of each cell of a frame of one line, by the head of its column."""
    shown = columns(REPORT, entry)
    found = re.findall(r"<td(?: class=\"number\" data-order=\"([^\"]*)\")?>([^<]*)</td>", html(shown, entry))
    return dict(zip(["scenario", *(column.head for column in shown)], found, strict=True))


def table(lines):
    return html(columns(REPORT, lines), lines)


def test_nothing_comes_from_elsewhere_and_names_are_text(text):
    assert "Content-Security-Policy" in text
    assert "default-src 'none'" in text
    assert not re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(?!data:)', text)
    assert "<script>alert(1)" not in text
    assert [entry["scenario"] for entry in data_of(text)] == [NASTY] * 4 + ["short"] * 4 + ["panda-blocked"]
    assert json.loads(embed({"a": "</script><!--"})) == {"a": "</script><!--"}
    assert "<" not in embed({"a": "</script><!--"})


def test_the_table_has_the_numbers_of_the_results(folder):
    rows = read_rows(folder / "results.json")
    shown = summarise(rows)
    assert shown.label.tolist() == ["dls", "moore_penrose", "dls:damping=0.05", "follow_nominal"] * 2 + ["dls"]
    here = [row for row in rows if (row.scenario, row.policy) == (NASTY, "moore_penrose")]
    line = cells(shown.iloc[[1]])
    assert float(line["total cost"][0]) == pytest.approx(math.prod(row.total_cost for row in here) ** (1 / EPISODES))
    assert float(line["pos max [mm]"][0]) == max(1e3 * row.position_error_max for row in here)
    assert line["at q̈ limit"][1] == str(sum(row.steps_at_acceleration_limit for row in here)) != "0"
    assert float(line["p50 [µs]"][0]) == here[0].time_p50_us  # the only one that was timed
    assert "cost ratio" not in line  # no best known cost


def test_the_interval_is_that_of_the_cost_ratio_over_the_episodes():
    rows = [dataclasses.replace(BASE, seed=seed, cost_ratio=1.0 + 0.1 * seed) for seed in range(1, 6)]
    low, high = geometric_interval([row.cost_ratio for row in rows])
    entry = summarise(rows)
    assert (entry.low[0], entry.high[0]) == (low, high)
    assert cells(entry)["95 %"] == (str(low), f"{low:.4g} … {high:.4g}")
    assert "95 %" not in cells(summarise(rows[:1]))
    # Total costs are no ratios: a policy with best known costs, next to one with an episode without.
    rows = [dataclasses.replace(BASE, seed=seed, cost_ratio=2.0) for seed in (0, 1)]
    rows += [dataclasses.replace(BASE, policy="other", seed=seed, cost_ratio=None) for seed in (0, 5)]
    first, second = (cells(summarise(rows).iloc[[line]]) for line in (0, 1))
    assert first["cost ratio"] == ("2.0", "2.000")
    assert not {"95 %", "worst"} & {*first, *second}
    known = [dataclasses.replace(row, scenario="known") for row in rows[:2]]
    # The ratio, its interval and the worst of the other one.
    assert table(summarise([*rows[2:], *known])).count(f'data-order="{LAST}">–') >= 3


def test_missing_numbers_are_dashes_and_sorted_last():
    missing = dict.fromkeys(("time_p50_us", "deadline_misses", "orientation_error_max"))
    worst = dataclasses.replace(BASE, total_cost=math.nan, position_error_max=math.inf, **missing)
    line = cells(summarise([worst]))
    assert not {"total cost", "p50 [µs]", "ori max [mrad]"} & set(line)
    assert line["lost"] == ("1", "1")
    # Costs, orientation, time and its misses.
    assert table(summarise([worst, dataclasses.replace(BASE, policy="b")])).count(f'data-order="{LAST}">–') == 4


def test_the_series_are_those_of_the_first_episodes(folder, text):
    lines = summarise(read_rows(folder / "results.json"))
    for entry, one in zip(data_of(text), lines.itertuples(), strict=True):
        assert entry["seed"] == one.first_seed
        assert entry["series"]["rows"] == one.steps
        assert len(entry["series"]["joint_names"]) == 7
        assert entry["series"]["arrays"]["q"]["shape"] == [min(one.steps, 400), 7]
    assert STEPS > 400
    largest = max(len(json.dumps(entry["series"])) for entry in data_of(text))
    assert len(text.encode()) + 2 * largest < 8e6  # a demo of ten policies


def test_a_folder_without_logs_has_a_page_and_a_damaged_log_is_named(folder, tmp_path):
    rows = read_rows(folder / "results.json")
    (tmp_path / "results.json").write_text(json.dumps([row.to_json() for row in rows]), encoding="utf-8")
    skipped = [Skipped("a", "<em>", "too <u>small")]
    written = page(results_of(tmp_path), summarise(rows), skipped, command="x < y", date=DATE).decode()
    assert [entry["series"] for entry in data_of(written)] == [None] * 9
    assert "&lt;em&gt; in a: too &lt;u&gt;small" in written
    file = results_of(tmp_path).series_file(rows[0])
    file.parent.mkdir(parents=True)
    file.write_bytes(b"nothing")
    with pytest.raises(ResultsError, match=r"npz is damaged"):
        page(results_of(tmp_path), summarise(rows), command="x", date=DATE)


def test_it_can_be_left_out_and_is_overwritten(tmp_path, capsys):
    arguments = ["--policies", "dls", "--steps", "5", "--out", str(tmp_path)]
    assert main([*arguments, "--no-report"]) == 0
    assert PAGE not in capsys.readouterr().out
    assert not (tmp_path / PAGE).exists()
    assert main([*arguments, "--overwrite"]) == 0
    assert capsys.readouterr().out.endswith(f"open {tmp_path / PAGE} in a browser\n")
    assert (tmp_path / PAGE).exists()
    evaluate("varga7-fast", "dls", steps=5, out=tmp_path, report=False, overwrite=True)
    assert not (tmp_path / PAGE).exists()  # it would show other results
