import dataclasses
import datetime
import json
import math

import numpy as np
import pytest

from baselines.evaluate import evaluate, main
from baselines.evaluation.html import PAGE, page
from baselines.evaluation.html.data import embedded, packed, unpacked
from baselines.evaluation.html.entries import entries
from baselines.evaluation.html.series import decoded
from baselines.evaluation.machine import describe
from baselines.evaluation.plan import Skipped
from baselines.evaluation.results import read_rows
from baselines.evaluation.summary import geometric_interval
from baselines.files import ResultsError
from tests.baselines.evaluation.html.conftest import EPISODES, NASTY, STEPS
from tests.baselines.evaluation.html.reading import Page, results_of
from tests.baselines.evaluation.test_report import BASE as ROW

BASE = dataclasses.replace(ROW, machine=describe())
DATE = datetime.datetime(2026, 1, 2, 3, 4, tzinfo=datetime.UTC)


@pytest.fixture(scope="module")
def shown(folder):
    return Page((folder / PAGE).read_text(encoding="utf-8"))


def of_rows(folder, rows):
    """The page of a folder that has nothing but rows."""
    content = json.dumps([row.to_json() for row in rows])
    folder.mkdir(exist_ok=True)
    (folder / "results.json").write_text(content, encoding="utf-8")
    written = page(results_of(folder), [Skipped("a", "<em>", "too <u>small")], command="x < y", date=DATE)
    return Page(written.decode())


def test_every_element_is_closed_and_nothing_comes_from_elsewhere(shown):
    assert shown.unbalanced == shown.open == []
    for tag, attributes in shown.elements:
        assert attributes.get("href", "#")[0] in "#d", (tag, attributes)  # within the page, or data
        assert "src" not in attributes
    (policy,) = [a["content"] for tag, a in shown.elements if tag == "meta" and a.get("http-equiv")]
    assert policy.startswith("default-src 'none'")  # what a browser would be asked to load, it would refuse


def test_a_name_is_a_name_and_no_markup(shown):
    assert shown.texts["h1"] == f"{NASTY}, short"
    assert sum(tag == "script" for tag, _ in shown.elements) == 3
    assert "alert(1)" not in shown.texts["script"]
    assert {line["scenario"] for line in shown.lines()} == {(NASTY, NASTY), ("short", "short")}


def test_the_rows_are_those_of_results_json(folder, shown):
    content = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    assert len(content) == 8 * EPISODES
    assert unpacked(shown.data["rows"]) == content
    assert unpacked(packed([])) == []


def test_the_table_has_the_numbers_of_the_results(folder, shown):
    rows = read_rows(folder / "results.json")
    lines = shown.lines()
    assert [line["policy"][1] for line in lines] == ["dls", "moore_penrose", "dls:damping=0.05", "follow_nominal *"] * 2
    own = [row for row in rows if (row.scenario, row.policy) == (NASTY, "moore_penrose")]
    line = lines[1]
    assert float(line["total cost"][0]) == pytest.approx(math.prod(row.total_cost for row in own) ** (1 / EPISODES))
    assert float(line["pos max [mm]"][0]) == max(row.position_error_max for row in own)
    assert line["at q̈ limit"][1] == str(sum(row.steps_at_acceleration_limit for row in own)) != "0"
    assert line["at q̇ limit"][1] == str(sum(row.steps_at_velocity_limit for row in own))
    assert float(line["p50 [µs]"][0]) == own[0].time_p50_us  # the only one that was timed
    assert line["cost ratio"] == ("", "–")  # nobody knows the best of this scenario


def test_the_interval_is_that_of_the_cost_ratio_over_the_episodes(tmp_path):
    rows = [dataclasses.replace(BASE, seed=seed, cost_ratio=1.0 + 0.1 * seed) for seed in range(1, 6)]
    low, high = geometric_interval([row.cost_ratio for row in rows])
    (entry,) = entries(rows)
    assert entry.interval == (low, high)
    (line,) = of_rows(tmp_path, rows).lines()
    assert line["95 %"] == (str(low), f"{low:.4g} … {high:.4g}")
    assert line["worst"] == ("1.5", "1.500")
    assert entries(rows[:1])[0].interval is None
    assert entries([*rows, dataclasses.replace(BASE, seed=9, cost_ratio=0.0)])[0].interval is None


def test_lost_and_missing_numbers_are_said_and_sorted_last(tmp_path):
    lost = {"total_cost": math.nan, "cost_ratio": math.inf, "position_error_max": math.inf}
    row = dataclasses.replace(BASE, **lost, time_p50_us=None, orientation_error_max=None)
    shown = of_rows(tmp_path, [row])
    (line,) = shown.lines()
    assert [line[name] for name in ("total cost", "p50 [µs]", "ori max [mrad]")] == [("", "–")] * 3
    assert line["lost"] == ("1", "1")
    (entry,) = shown.data["entries"]
    assert entry["value"] is None
    assert entry["series"] is None  # nothing was played here
    assert unpacked(shown.data["rows"]) == [row.to_json()]


def test_what_was_skipped_and_the_command_are_text(tmp_path):
    shown = of_rows(tmp_path, [BASE])
    assert not any(tag in ("em", "u") for tag, _ in shown.elements)


def test_the_series_are_those_of_the_first_episodes(folder, shown):
    results, data = results_of(folder), shown.data["entries"]
    assert [entry["scenario"] for entry in data] == [NASTY] * 4 + ["short"] * 4
    for entry, one in zip(data, entries(results.rows), strict=True):
        log, arrays = results.series(one.rows[0]), entry["series"]["arrays"]
        assert entry["seed"] == one.rows[0].seed
        assert entry["series"]["rows"] == one.summary.steps
        np.testing.assert_array_equal(decoded(arrays["q"]), log["q"][log["frame"]].astype(np.float32))
        assert decoded(arrays["time"])[-1] == pytest.approx(log["time"][-1])
    assert decoded(data[0]["series"]["arrays"]["q"]).shape == (400, 7)
    assert STEPS > 400


def test_a_folder_without_logs_has_a_page_and_a_damaged_log_is_named(folder, tmp_path):
    rows = read_rows(folder / "results.json")
    assert [entry["series"] for entry in of_rows(tmp_path, rows).data["entries"]] == [None] * 8
    file = results_of(tmp_path).series_file(rows[0])
    file.parent.mkdir(parents=True)
    file.write_bytes(b"nothing")
    with pytest.raises(ResultsError, match=r"Cannot read .*npz"):
        of_rows(tmp_path, rows)


def test_no_text_ends_its_element():
    text = embedded({"a": "</script><!--<script>"})
    assert "<" not in text
    assert json.loads(text) == {"a": "</script><!--<script>"}


def test_it_can_be_left_out_and_is_overwritten(tmp_path, capsys):
    arguments = ["--policies", "dls", "--steps", "5", "--no-plots", "--out", str(tmp_path)]
    assert main([*arguments, "--no-report"]) == 0
    assert PAGE not in capsys.readouterr().out
    assert not (tmp_path / PAGE).exists()
    assert main([*arguments, "--overwrite"]) == 0
    assert capsys.readouterr().out.endswith(f"open {tmp_path / PAGE} in a browser\n")
    assert (tmp_path / PAGE).exists()
    evaluate("varga7-fast", "dls", steps=5, out=tmp_path, plots=False, report_page=False, overwrite=True)
    assert not (tmp_path / PAGE).exists()  # it would show other results


def test_a_demo_of_ten_policies_stays_below_8_mb(shown, folder):
    series = [len(json.dumps(entry["series"])) for entry in shown.data["entries"]]
    assert len((folder / PAGE).read_bytes()) + 2 * max(series) < 8e6


@pytest.mark.slow
def test_256_episodes_of_25_policies_stay_below_20_mb(full_folder):
    written = (full_folder / PAGE).read_bytes()
    assert 8e6 < len(written) < 20e6
    data = Page(written.decode()).data
    assert len(data["rows"]["seed"]) == 25 * 256
    assert len(data["entries"]) == 25
    assert all(entry["series"]["arrays"]["q"]["shape"][0] > 100 for entry in data["entries"])
