"""The tables of results can be measured again from their own lines."""

from __future__ import annotations

import pytest

from baselines import registry
from baselines.evaluation.records import from_csv
from baselines.spec import parse_policy
from baselines.tuning.ranges import RANGES, read
from docs import measure

POSE = from_csv((measure.RESULTS / "pose.csv").read_text(encoding="utf-8"))
#: Solvers of short sight that have settings to be tuned, but take hours: those of the paper.
SLOW = {"rhc_gradient", "full_orientation"}
HEAD = "policy,scenario,seeds,episodes,cost_ratio,time_p99_us,front\n"


@pytest.mark.parametrize("name", sorted({spec.partition(":")[0] for spec in read(RANGES)} - SLOW))
def test_tuned_solvers_have_two_rows(name):
    """One with the defaults and one with the settings that were tuned on validation episodes."""
    here = [one["policy"] for one in POSE if one["scenario"] == measure.SCENARIO and parsed(one["policy"])[0] == name]
    assert len(here) >= 2


def test_agents_stand_beside_their_untrained_network():
    rows = {one["policy"]: one for one in POSE if one["scenario"] == measure.SCENARIO}
    assert {"agent_alone", "untrained"} <= rows.keys()
    assert int(rows["untrained"]["seeds"]) == len(measure.SEEDS)


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


def test_new_lines_are_measured_and_the_others_stay(tmp_path, monkeypatch):
    for name in ("RESULTS", "WORK", "RUNS"):
        monkeypatch.setattr(measure, name, tmp_path)
    text = HEAD + "mine,varga7-fast,1,1,7.5,3,no\nbroyden,varga7-fast,1,1,0.5,4,yes\ndls,varga7-fast,1,1,,,\n"
    (tmp_path / "some.csv").write_text(text)
    low, new, high = measure.measured("some", only_new=True)
    assert (low["policy"], low["cost_ratio"], low["time_p99_us"]) == ("broyden", "0.5", "4")
    assert (high["policy"], high["cost_ratio"]) == ("mine", "7.5")
    assert (new["policy"], new["time_p99_us"]) == ("dls", None)
    assert new["cost_ratio"] == pytest.approx(1.9148, rel=1e-4)
    every = {one["policy"]: one for one in measure.measured("some")}
    assert float(every["broyden"]["cost_ratio"]) > 1.0
    assert every["dls"]["time_p99_us"] > 0.0
    assert every["mine"]["cost_ratio"] == "7.5"


def test_times_are_measured_alone(tmp_path, monkeypatch):
    for name in ("RESULTS", "WORK", "RUNS"):
        monkeypatch.setattr(measure, name, tmp_path)
    (tmp_path / "some.csv").write_text(
        HEAD + "mine,varga7-fast,1,1,3.5,3,no\nbroyden,varga7-fast,1,1,2.5,,no\ndls,varga7-fast,1,1,0.5,,yes\n"
    )
    dls, broyden, old = measure.measured("some", only_times=True)
    assert (dls["policy"], broyden["policy"], old["policy"]) == ("dls", "broyden", "mine")
    assert (dls["cost_ratio"], old["time_p99_us"]) == ("0.5", "3")
    assert min(dls["time_p99_us"], broyden["time_p99_us"]) > 0.0


def test_intervals_have_costs_and_times(monkeypatch):
    monkeypatch.setattr(measure, "INTERVALS", (1, 64))
    monkeypatch.setattr(measure, "EPISODES", 2)
    monkeypatch.setattr(measure, "BATCHED", 64)
    every, seldom = measure.intervals(only_new=False)
    assert (every["interval"], every["times_every_step"]) == (1, 1.0)
    assert seldom["times_every_step"] > 1.0
    assert all(0.0 < row["time_mean_us"] <= row["time_max_us"] for row in (every, seldom))
    assert seldom["time_batch_us"] < every["time_batch_us"]


def test_plants_are_measured_by_the_lines_of_their_table(tmp_path, monkeypatch):
    monkeypatch.setattr(measure, "RESULTS", tmp_path)
    monkeypatch.setattr(measure, "ADAPTIVE", {"mine": ("dls", {"gain": 0.5})})
    head = "policy,scenario,episodes,cost_ratio,low,high,worst\n"
    (tmp_path / "plants.csv").write_text(f"{head}mine,panda-payload,2,,,,\nother,panda-bus,2,1.5,1.4,1.6,1.6\n")
    new, old = measure.plants(only_new=True)
    assert 1.0 < new["low"] < new["cost_ratio"] < new["high"] <= new["worst"]
    assert old["cost_ratio"] == "1.5"
