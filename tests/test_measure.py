"""The tables of results can be measured again from their lines."""

from __future__ import annotations

import pytest

from baselines import registry
from baselines.registry import parse_policy
from baselines.tuning.ranges import RANGES, read_ranges
from docs import keeping, measure

POSE = [one for one in keeping.lines("cost_time") if one["scenario"] == "varga7-pose-random"]
#: Solvers of short sight that have settings to be tuned, but take hours: those of the paper.
SLOW = {"rhc_gradient", "full_orientation"}
HEAD = "policy,scenario,seeds,episodes,cost_ratio,time_p99_us,front\n"


@pytest.mark.parametrize("name", sorted({spec.partition(":")[0] for spec in read_ranges(RANGES)} - SLOW))
def test_tuned_solvers_have_two_rows(name):
    """One with the defaults and one with the settings that were tuned on validation episodes."""
    assert sum(parsed(one["policy"])[0] == name for one in POSE) >= 2


def parsed(policy):
    return parse_policy(policy) if registry.known(policy.partition(":")[0]) else (policy, {})


def test_the_policies_of_a_line(tmp_path, monkeypatch):
    monkeypatch.setattr(measure, "RUNS", tmp_path)
    assert measure.policies({"policy": "dls", "seeds": "1"}) == ["dls"]
    seeds = ["rhc_foresight:horizon=9,seed=0", "rhc_foresight:horizon=9,seed=1"]
    assert measure.policies({"policy": "rhc_foresight:horizon=9", "seeds": "2"}) == seeds
    assert measure.policies({"policy": "mine", "seeds": "1"}) == []
    file = tmp_path / "mine" / "seed-0" / "agent.safetensors"
    file.parent.mkdir(parents=True)
    file.touch()
    assert measure.policies({"policy": "mine", "seeds": "1"}) == [f"agent:{file}"]


@pytest.fixture
def table(tmp_path, monkeypatch):
    """Writes a table into a temporary folder."""
    for name in ("RESULTS", "WORK"):
        monkeypatch.setattr(keeping, name, tmp_path)
    monkeypatch.setattr(measure, "RUNS", tmp_path)
    return lambda name, text: (tmp_path / f"{name}.csv").write_text(text)


def test_new_lines_are_measured_and_the_others_stay(table):
    table("some", HEAD + "mine,varga7-fast,1,1,7.5,3,no\nbroyden,varga7-fast,1,1,0.5,4,yes\ndls,varga7-fast,1,1,,,\n")
    low, new, high = measure.measure_lines("some", only_new=True)
    assert (low["policy"], low["cost_ratio"], low["time_p99_us"]) == ("broyden", "0.5", "4")
    assert (high["policy"], high["cost_ratio"]) == ("mine", "7.5")
    assert new["policy"] == "dls"
    assert new["cost_ratio"] == pytest.approx(1.9148, rel=1e-4)
    every = {one["policy"]: one for one in measure.measure_lines("some")}
    assert float(every["broyden"]["cost_ratio"]) > 1.0
    assert every["dls"]["time_p99_us"] > 0.0
    assert every["mine"]["cost_ratio"] == "7.5"


def test_costs_relative_to_the_lowest_are_measured_together(table):
    """At another control period, too: there are no best known costs."""
    head = "period_ms,policy,scenario,episodes,relative_to,cost_ratio,error_mm\n"
    here = "varga7-fast at 2 ms,1,lowest in the table"
    table("some", f"{head}2,qp,{here},7.5,\n2,dls,{here},,\n")
    best, other = measure.measure_lines("some", only_new=True)
    assert (best["cost_ratio"], best["period_ms"], best["scenario"]) == (1.0, "2", "varga7-fast at 2 ms")
    assert 1.0 < other["cost_ratio"] != 7.5
    assert best["error_mm"] > 0.0


def test_a_label_stands_for_a_policy(table):
    """With noise seeds, too."""
    head = "policy,scenario,episodes,noise_seeds,cost_ratio,low,high,spec\n"
    table("some", f'{head}mine,panda-field,2,2,,,,dls:gain=0.5\nother,panda-bus,2,1,1.5,1.4,1.6,"qp:gain=0.5"\n')
    new, old = measure.measure_lines("some", only_new=True)
    assert (new["policy"], new["spec"]) == ("mine", "dls:gain=0.5")
    assert 1.0 < new["low"] < new["cost_ratio"] < new["high"]
    assert old["cost_ratio"] == "1.5"


def test_no_line_is_lost_with_a_policy_that_cannot_be_played(table):
    table("some", HEAD + "dls,varga7-fast,1,1,,,\nagent_track,varga7-fast,1,1,,,\n")
    with pytest.raises(SystemExit, match="agent_track in varga7-fast: "):
        measure.measure_lines("some", only_new=True)


def test_the_lines_of_plants_can_be_played():
    for line in keeping.lines("plants"):
        name, parameters = parsed(line["spec"])
        registry.make(name, line["scenario"], **parameters, **{"seed": 0} if name == "told" else {})


@pytest.mark.parametrize(
    ("name", "message"), [("nothing", "expected names of tables, got 'nothing'"), ("drift", "measured as a whole")]
)
def test_a_table_that_cannot_be_measured(name, message):
    with pytest.raises(SystemExit, match=message):
        measure.table_of(name, only_new=True)
