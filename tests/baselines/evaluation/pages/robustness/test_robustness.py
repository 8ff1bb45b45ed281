"""The map and the tables: played, kept, taken up again, drawn and written."""

from __future__ import annotations

import dataclasses
import functools
import io
import json

import numpy as np
import PIL.Image
import pytest
from matplotlib.text import Text

import ikgym
from baselines.evaluation import test_sets
from baselines.evaluation.pages.robustness import measure, pictures
from baselines.evaluation.pages.robustness.command import main
from baselines.evaluation.pages.robustness.measured import Cell, Entry, Measured
from baselines.evaluation.pages.robustness.page import page
from baselines.evaluation.report import number
from baselines.evaluation.results import read_rows
from baselines.files import ResultsError
from baselines.fingerprints import set_hash
from baselines.oracle import Search, cache, search, solve
from baselines.workers import Workers
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import imperfect
from tests.baselines.evaluation.test_report import row
from tests.baselines.workers.losing import LosingPool, instead

STEPS = 30
ENTRY = Entry("panda-camera", "dls", False, 64, 650.0, (500.0, 800.0), 0.25, 1.2, 540.0, (400.0, 700.0))
CELLS = tuple(
    Cell(policy, knowledge, drives, ratio, ratio / 2.0, 2.0 * ratio, lost)
    for policy, ratio, lost in (("dls", 300.0, 0.5), ("rhc", 20.0, 0.0), ("told", 1.05, 0.0))
    for knowledge in (0.0, 1.0)
    for drives in (0.0, 1.0)
)
MEASURED = Measured(
    "a command", "2000-01-01", {"cpu": "a machine"}, "panda-field", 4, ("told",), (ENTRY,), CELLS
)  # fmt: skip


@pytest.fixture
def short(monkeypatch, tmp_path):
    """Scenarios of some steps, and best known costs that are searched within them."""
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setattr(imperfect, "STEPS", STEPS)
    monkeypatch.setattr(imperfect, "FIELD", imperfect.FIELD.replace(payload_step=STEPS // 2))
    monkeypatch.setattr(measure, "HOW", Search(starts=0, generations=0))
    monkeypatch.setattr(search, "HORIZONS", ())


def arguments(tmp_path, *more):
    chosen = ["--policies", "dls", "told:policy=dls", "--severities", "0.5", "--episodes", "2"]
    return [*chosen, "--out", str(tmp_path / "out"), "--write", str(tmp_path / "docs"), *more]


def test_plays_writes_and_writes_anew(short, tmp_path, capsys):
    assert main(arguments(tmp_path)) == 0
    file = tmp_path / "docs" / "robustness.md"
    assert str(file) in capsys.readouterr().out
    found, text = Measured.load(file.with_suffix(".json")), file.read_text(encoding="utf-8")
    assert [cell.policy for cell in found.cells] == ["dls", "told:policy=dls"]
    assert found.references == ("told:policy=dls",)
    assert "2 test episodes of each\npolicy in each cell" in text
    rows = read_rows(tmp_path / "out" / "panda-field" / "results.json")
    assert {one.seed for one in rows} == {2_000_000, 2_000_001}
    for name in ("best", "dls", "told_policy=dls"):
        picture = tmp_path / "docs" / "images" / f"robustness-{name}.png"
        assert PIL.Image.open(io.BytesIO(picture.read_bytes())).size[0] > 500
    file.unlink()
    assert main(["--write", str(tmp_path / "docs")]) == 0
    assert file.read_text(encoding="utf-8") == text
    capsys.readouterr()
    assert main(arguments(tmp_path)) == 2
    assert "--resume" in capsys.readouterr().err


def test_a_run_is_taken_up_again(short, tmp_path):
    play = functools.partial(measure.cells, "panda-field", ["dls"], tmp_path, severities=[0.5], episodes=3)
    results = tmp_path / "panda-field" / "results.json"
    cells, whole = play(), json.loads(results.read_text())
    changed = [{**one, "total_cost": 2.0 * one["total_cost"]} for one in whole[:2]]
    results.write_text(json.dumps(changed))
    (again,) = play(resume=True)
    assert json.loads(results.read_text()) == [*changed, whole[2]]  # what was there was not played again
    assert again.cost_ratio == pytest.approx(4.0 ** (1 / 3) * cells[0].cost_ratio, rel=1e-6)


def test_a_cluster_changes_nothing(short, tmp_path, monkeypatch):
    play = functools.partial(measure.cells, "panda-field", ["dls"], severities=[0.5], episodes=2)
    here = play(tmp_path / "here")
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "empty"))
    pool = instead(monkeypatch, LosingPool(lost=[0, 2]))
    assert play(tmp_path / "there", workers=Workers(cluster="ray")) == here
    assert len(pool.units) == 1 + 2 + 2  # a block of two seeds, two best known costs, and what was lost


def test_ratios_are_to_the_best_known_cost_of_the_arm_that_moves(short, tmp_path):
    cells = measure.cells("panda-field", ["dls"], tmp_path, severities=[0.5], episodes=2)
    scenario = measure.at("panda-field", (0.5, 0.5))
    rows = read_rows(tmp_path / "panda-field" / "results.json")
    bounds = [solve(scenario, one.seed, measure.HOW).cost for one in rows]
    ratio = np.exp(np.mean(np.log([one.total_cost / bound for one, bound in zip(rows, bounds, strict=True)])))
    assert cells[0].cost_ratio == pytest.approx(ratio, rel=1e-6)
    assert cells[0].cost_ratio > 1.0


def test_places_of_the_map():
    assert measure.places([0.0, 1.0]) == [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)]
    worst = measure.at("panda-field", (1.0, 1.0))
    assert (worst.name, worst.plant) == ("panda-field 1 1", imperfect.FIELD)
    assert measure.at("panda-bus", (0.3, 1.0)).plant == ikgym.scenarios.get("panda-bus").plant
    with pytest.raises(InvalidInputError, match="expected a plant that is not ideal"):
        measure.at("panda-ideal", (1.0, 1.0))


def test_tables_of_test_sets(short, tmp_path, monkeypatch):
    scenario = ikgym.scenarios.get("panda-bus").replace(steps=STEPS)
    monkeypatch.setattr(test_sets.TestSet, "scenario", property(lambda self: scenario))
    small = test_sets.TestSet("panda-bus", 2, set_hash(scenario, ikgym.scenarios.seeds("test", 2)))
    monkeypatch.setitem(test_sets.SETS, "panda-bus", small)
    (entry,) = measure.entries(["panda-bus"], ["dls"], tmp_path)
    assert (entry.scenario, entry.episodes, entry.reference) == ("panda-bus", 2, False)
    assert entry.paired > 1.0
    low, high = entry.paired_interval
    assert low <= entry.paired <= high
    assert entry.cost_ratio is None  # of so few steps no best known cost is recorded


def texts(figure):
    return " ".join(text.get_text() for text in figure.findobj(Text))


def test_the_pictures_say_what_was_measured():
    own = [cell for cell in CELLS if cell.policy == "dls"]
    drawn = texts(pictures.one("dls", own))
    assert number(300.0) in drawn
    assert "50 % lost" in drawn
    assert "severity of lag and delay" in drawn
    best = texts(pictures.best(CELLS[:8]))
    assert best.count("rhc") == 4
    assert "dls" not in best


def test_a_policy_that_loses_nothing_is_better():
    cheap = [dataclasses.replace(cell, cost_ratio=1.0, lost=0.25) for cell in CELLS[:4]]
    assert "dls" not in texts(pictures.best([*cheap, *CELLS[4:8]]))


def test_the_page():
    text = page(MEASURED)
    assert "| `dls` | 650.0 | 500.0 … 800.0 | 25 % | 1.200 | 540.0 | 400.0 … 700.0 |" in text
    assert "64 test episodes, 3 noise seeds each." in text
    assert text.index("Best policy of each cell") < text.index("Cost ratios of dls")
    marked = dataclasses.replace(ENTRY, policy="told", reference=True, cost_ratio=None, interval=None, paired=None)
    assert "| `told` * | – | – |" in page(dataclasses.replace(MEASURED, entries=(marked,)))


def test_what_is_saved_is_read(tmp_path):
    MEASURED.save(tmp_path / "robustness.json")
    assert Measured.load(tmp_path / "robustness.json") == MEASURED
    (tmp_path / "robustness.json").write_text("{}")
    with pytest.raises(ResultsError, match="Cannot read what was measured"):
        Measured.load(tmp_path / "robustness.json")


def test_a_cell_counts_noise_seeds_once_and_lost_ones_each():
    rows = [row(seed=0, noise_seed=n, total_cost=c, position_error_max=e) for n, c, e in ((0, 2.0, 0.1), (1, 8.0, 0.0))]
    cell = Cell.of("dls", (0.0, 1.0), [*rows, row(seed=1, total_cost=16.0)], {0: 1.0, 1: 1.0})
    assert cell.cost_ratio == pytest.approx(8.0)
    assert cell.lost == pytest.approx(1.0 / 3.0)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([], "Expected --out, where the results go"),
        (["--out", "x", "--severities", "-1"], "severities"),
        (["--out", "x", "--severities"], "got neither"),
        (["--out", "x", "--episodes", "0"], "episodes"),
        (["--out", "x", "--scenario", "panda-feild"], "Did you mean"),
        (["--out", "x", "--policies", "nobody"], "There is no policy 'nobody'"),
    ],
)
def test_mistakes_are_one_line(given, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(given) == 2
    said = capsys.readouterr().err
    assert words in said
    assert len(said.splitlines()) == 1
