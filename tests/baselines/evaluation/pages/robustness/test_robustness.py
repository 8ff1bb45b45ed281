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
from baselines.evaluation.pages.robustness.command import labelled, main, some_of, whole
from baselines.evaluation.pages.robustness.measured import Cell, Effect, Entry, Measured
from baselines.evaluation.pages.robustness.page import page
from baselines.evaluation.report import number
from baselines.evaluation.results import read_rows
from baselines.files import ResultsError
from baselines.fingerprints import set_hash
from baselines.oracle import Search, cache, search, solve
from baselines.workers import Workers
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.scenarios import imperfect
from tests.baselines.evaluation.test_report import row
from tests.baselines.losing import LosingCluster

STEPS = 30
ENTRY = Entry("panda-camera", "dls", False, 64, 650.0, (500.0, 800.0), 0.25, 1.2, 540.0, (400.0, 700.0))
CELLS = tuple(
    Cell(policy, knowledge, drives, ratio, ratio / 2.0, 2.0 * ratio, lost)
    for policy, ratio, lost in (("dls", 300.0, 0.5), ("rhc", 20.0, 0.0), ("told", 1.05, 0.0))
    for knowledge in (0.0, 1.0)
    for drives in (0.0, 1.0)
)
MEASURED = Measured(
    "a command", "2000-01-01", {"cpu": "a machine"}, "panda-field", 4, ("told",), (ENTRY,), CELLS,
    {"dls": "dls", "rhc": "rhc:iterations=1", "told": "told"}, (Effect("dls", "payload", 3.0, 2.0, 4.0, 0.25),),
)  # fmt: skip


@pytest.fixture
def short(monkeypatch, tmp_path):
    """Scenarios of some steps, and best known costs that are searched within them."""
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setattr(scenarios._registry, "_made", {})  # short ones would be there for all tests to come
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
    play = functools.partial(measure.cells, "panda-field", {"dls": "dls"}, tmp_path, severities=[0.5], episodes=3)
    results = tmp_path / "panda-field" / "results.json"
    cells, whole = play(), json.loads(results.read_text())
    changed = [{**one, "total_cost": 2.0 * one["total_cost"]} for one in whole[:2]]
    results.write_text(json.dumps(changed))
    (again,) = play(resume=True)
    assert json.loads(results.read_text()) == [*changed, whole[2]]  # what was there was not played again
    assert again.cost_ratio == pytest.approx(4.0 ** (1 / 3) * cells[0].cost_ratio, rel=1e-6)


def test_a_cluster_changes_nothing(short, tmp_path, monkeypatch):
    play = functools.partial(measure.cells, "panda-field", {"dls": "dls"}, severities=[0.5], episodes=2)
    here = play(tmp_path / "here")
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "empty"))
    pool = LosingCluster(monkeypatch, lost=[0, 2])
    assert play(tmp_path / "there", workers=Workers(cluster="ray")) == here
    assert len(pool.units) == 1 + 2 + 2  # a block of two seeds, two best known costs, and what was lost


def test_a_path_that_is_always_the_same_has_one_episode_a_cell(short, tmp_path):
    plant = ikgym.Plant(command_delay=2)
    scenarios.get("panda-circle").replace(name="late", steps=STEPS, plant=plant).save(tmp_path / "late.toml")
    (cell,) = measure.cells(str(tmp_path / "late.toml"), {"dls": "dls"}, tmp_path / "out", severities=[1.0], episodes=2)
    assert cell.cost_ratio > 1.0
    assert {row.seed for (file,) in [[*tmp_path.glob("out/*/results.json")]] for row in read_rows(file)} == {0}


def test_ratios_are_to_the_best_known_cost_of_the_arm_that_moves(short, tmp_path):
    cells = measure.cells("panda-field", {"low gain": "dls:gain=0.1"}, tmp_path, severities=[0.5], episodes=2)
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
    (entry,) = measure.entries(["panda-bus"], {"dls": "dls"}, tmp_path)
    assert (entry.scenario, entry.episodes, entry.reference) == ("panda-bus", 2, False)
    assert entry.paired > 1.0
    low, high = entry.paired_interval
    assert low <= entry.paired <= high
    assert entry.cost_ratio is None  # of so few steps no best known cost is recorded


def test_the_first_episodes_of_sets(short, tmp_path, monkeypatch):
    scenario = ikgym.scenarios.get("panda-bus").replace(steps=STEPS)
    monkeypatch.setattr(test_sets.TestSet, "scenario", property(lambda self: scenario))
    small = test_sets.TestSet("panda-bus", 2, set_hash(scenario, ikgym.scenarios.seeds("test", 2)))
    monkeypatch.setitem(test_sets.SETS, "panda-bus", small)
    (entry,) = measure.entries(["panda-bus"], {"dls": "dls"}, tmp_path, episodes=1)
    assert entry.episodes == 1
    text = page(dataclasses.replace(MEASURED, entries=(entry,)))
    assert "more than the first episodes, as their tables say: panda-bus." in text
    assert "\n1 test episodes.\n" in text
    assert "Best known costs are missing of panda-bus" in text


def test_some_policies_play_whole_sets(short, tmp_path, monkeypatch):
    scenario = ikgym.scenarios.get("panda-bus").replace(steps=STEPS)
    monkeypatch.setattr(test_sets.TestSet, "scenario", property(lambda self: scenario))
    small = test_sets.TestSet("panda-bus", 3, set_hash(scenario, ikgym.scenarios.seeds("test", 3)))
    monkeypatch.setitem(test_sets.SETS, "panda-bus", small)
    policies = {"low": "dls:gain=0.1", "dls": "dls"}
    some = measure.entries(["panda-bus"], policies, tmp_path, episodes=1, whole={("dls", "panda-bus")})
    assert {one.policy: one.episodes for one in some} == {"low": 1, "dls": 3}
    on_ideal = [one for one in read_rows(tmp_path / "sets" / "results.json") if one.scenario != "panda-bus"]
    assert len(on_ideal) == 4  # an ideal episode beside each
    text = page(dataclasses.replace(MEASURED, entries=some))
    assert "\n3 or 1 test episodes.\n" in text
    assert text.count("| 3 | –") == 1


def test_whole_sets_are_named_by_label_and_set():
    assert whole(["a@b@panda-bus"], ["a@b"], ["panda-bus"]) == {("a@b", "panda-bus")}
    assert not whole([], ["dls"], [])
    with pytest.raises(UnknownNameError, match=r"There is no label 'dsl'\. Did you mean 'dls'"):
        whole(["dsl@panda-bus"], ["dls"], ["panda-bus"])
    with pytest.raises(UnknownNameError, match="no set among --sets 'panda-bsu'"):
        whole(["dls@panda-bsu"], ["dls"], ["panda-bus"])


def test_some_policies_are_on_the_map(short, tmp_path):
    assert main([*arguments(tmp_path, "--mapped", "dls"), "--episodes", "1"]) == 0
    found = Measured.load(tmp_path / "docs" / "robustness.json")
    assert [cell.policy for cell in found.cells] == ["dls"]
    assert list(found.policies) == ["dls", "told:policy=dls"]
    assert some_of({"a": "dls", "b": "rhc"}, ()) == {"a": "dls", "b": "rhc"}
    with pytest.raises(UnknownNameError, match="There is no label 'dsl'"):
        some_of({"dls": "dls"}, ["dsl"])


def test_effects_alone(short, tmp_path):
    parts = measure.effects_of(imperfect.FIELD)
    assert list(parts) == list(measure.EFFECTS)
    assert {name for part in parts.values() for name in part.switched_on()} == set(imperfect.FIELD.switched_on())
    assert list(measure.effects_of(ikgym.scenarios.get("panda-bus").plant)) == [
        "lag of the drives",
        "delay of commands",
    ]
    found = measure.effects("panda-field", {"low": "dls:gain=0.1"}, tmp_path, episodes=2)
    assert [(one.policy, one.name) for one in found] == [("low", name) for name in parts]
    assert all(one.low <= one.paired <= one.high for one in found)
    assert found[0].paired > 1.0
    rows = [row(seed=seed, total_cost=cost) for seed, cost in ((0, 2.0), (1, 8.0))]
    effect = Effect.of("dls", "lag", rows, [row(seed=0, total_cost=1.0), row(seed=1, total_cost=1.0)])
    assert effect.paired == pytest.approx(4.0)


def test_labels_of_policies():
    assert labelled(["dls", "low@dls:gain=0.1"]) == {"dls": "dls", "low": "dls:gain=0.1"}
    with pytest.raises(InvalidInputError, match="label of its own"):
        labelled(["dls", "dls@rhc"])


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
    assert "| `dls` | 64 | 650.0 | 500.0 … 800.0 | 25 % | 1.200 | 540.0 | 400.0 … 700.0 |" in text
    assert "64 test episodes, 3 noise seeds each." in text
    assert "- `rhc` is `rhc:iterations=1`" in text
    assert "- `dls` is" not in text
    assert "Not measured yet: panda-ideal" in text
    assert "| policy | payload |" in text
    assert "| `dls` | 3.000 [2.000 … 4.000] (25 %) |" in text
    assert text.index("Best policy of each cell") < text.index("Cost ratios of dls")
    marked = dataclasses.replace(ENTRY, policy="told", reference=True, cost_ratio=None, interval=None, paired=None)
    assert "| `told` * | 64 | – | – |" in page(dataclasses.replace(MEASURED, entries=(marked,)))


def test_goals_are_held_against_the_best_of_those_that_played_most():
    cheap = dataclasses.replace(ENTRY, policy="rhc", cost_ratio=1.2, interval=(1.1, 1.3), lost=0.0)
    few = dataclasses.replace(cheap, policy="few", episodes=4, cost_ratio=1.1)
    told = dataclasses.replace(cheap, policy="told", reference=True, cost_ratio=1.02)
    text = page(dataclasses.replace(MEASURED, entries=(ENTRY, few, told, cheap)))
    assert "| panda-camera | `rhc` | 64 | 1.200 | 1.100 … 1.300 | 0 % | 1.020 | 1.400 | yes |" in text
    for changed in ({"cost_ratio": 1.41}, {"lost": 0.01}):
        missed = dataclasses.replace(cheap, **changed)
        assert "| 1.400 | no |" in page(dataclasses.replace(MEASURED, entries=(missed,)))
    assert "| 1.400 | yes, so far |" in page(dataclasses.replace(MEASURED, entries=(few,)))
    assert "## Goals" not in page(dataclasses.replace(MEASURED, entries=(told,)))


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
