"""Policies compared with themselves on an ideal plant."""

import dataclasses

import numpy as np
import pytest

import ikgym
from baselines.evaluate import evaluate
from baselines.evaluation import report
from baselines.evaluation.columns import number
from baselines.evaluation.summary import summarise
from ikgym import Plant
from tests.baselines.evaluation.planning import planned
from tests.baselines.evaluation.test_report import row

SHORT = {name: ikgym.scenarios.get(name).replace(steps=16) for name in ("panda-ideal", "panda-camera", "panda-bus")}


def rows_of(costs, scenario="lab", fingerprint="1", ideal="0", **changes):
    """Rows of one policy, by seed and noise seed."""
    return [
        row(
            scenario=scenario,
            fingerprint=fingerprint,
            ideal=ideal,
            seed=seed,
            noise_seed=noise,
            total_cost=cost,
            **changes,
        )
        for seed, several in enumerate(costs)
        for noise, cost in enumerate(several)
    ]


PLAIN = rows_of([[1.0], [2.0], [4.0]], "plain", "0")


def test_noise_seeds_count_as_one_episode():
    line = summarise(rows_of([[1.0, 4.0], [8.0, 32.0]])).loc[0]
    assert line["episodes"] == 2
    assert line["mean"] == line["total_cost"] == pytest.approx(np.sqrt(2.0 * 16.0))
    assert (line["worst"], line["worst_seed"]) == (pytest.approx(16.0), 1)


def times_ideal(rows):
    """The factor of the last policy with its interval."""
    return summarise(rows)[["times_ideal", "times_ideal_low", "times_ideal_high"]].iloc[-1].tolist()


def test_the_ratio_of_each_seed():
    mean, low, high = times_ideal([*PLAIN, *rows_of([[3.0, 3.0], [2.0, 8.0], [12.0, 12.0]])])
    assert mean == pytest.approx((3.0 * 2.0 * 3.0) ** (1 / 3))
    assert low <= mean <= high
    assert (low, high) == (pytest.approx(2.0), pytest.approx(3.0))


def test_only_seeds_of_both_count_and_others_are_no_pairs():
    assert times_ideal([*PLAIN, *rows_of([[3.0], [6.0], [12.0], [1e9]])]) == [pytest.approx(3.0)] * 3
    perturbed = rows_of([[3.0]] * 3)
    other_policy, other_settings = (
        [dataclasses.replace(one, **change) for one in PLAIN] for change in ({"policy": "rhc"}, {"parameters": {}})
    )
    for plain in (other_policy, other_settings, rows_of([[1.0]] * 3, "plain", "2", "2")):
        assert np.isnan(times_ideal([*plain, *perturbed])).all()


def test_the_plan_adds_the_ideal_plants_once():
    jobs = planned([SHORT["panda-camera"], SHORT["panda-bus"]], "dls", episodes=2, pairs=True, noise_seeds=2).jobs
    names = [job.scenario.name for job in jobs]
    assert names == ["panda-camera"] * 4 + ["panda-bus"] * 2 + ["panda-camera, ideal plant"] * 2
    assert jobs[-1].scenario.plant.ideal
    assert [job.seeds.seed for job in jobs[-2:]] == [2_000_000, 2_000_001]


def test_tables_show_the_pairs():
    rows = evaluate(SHORT["panda-bus"], "dls", episodes=3, pairs=True)
    text = report.table(summarise(rows))
    bus, plain = ([one.total_cost for one in rows if ("ideal" in one.scenario) == ideal] for ideal in (False, True))
    ratio = np.exp(np.mean(np.log(np.array(bus) / plain)))
    line = next(line for line in text.split("over the episodes")[1].splitlines() if line.startswith("dls"))
    assert number(float(ratio)) in line.split()
    assert "…" in line
    assert "× ideal: its cost divided by that on the ideal plant" in " ".join(text.split())
    assert "× ideal" not in report.table(summarise([one for one in rows if "ideal" not in one.scenario]))


def test_policies_that_lose_the_path_at_the_delay_margin_are_named():
    """A share K of an error is corrected stably below 2 sin(π / (2 (2 d + 1))): 1.0 where d = 1, 0.62 where d = 2."""
    scenario = ikgym.scenarios.get("panda-circle").replace(plant=Plant(command_delay=1, delay_margin=1.0), steps=600)
    rows = evaluate(scenario, ["dls:gain=0.8", "dls:gain=0.2"])
    assert [row.scenario for row in rows] == ["panda-circle"] * 2 + ["panda-circle, later"] * 2
    assert rows[0].followed
    assert not rows[2].followed
    alone = evaluate(scenario.replace(plant=Plant(command_delay=2)), "dls:gain=0.8")
    assert alone[0].total_cost == rows[2].total_cost
    (line,) = [line for line in report.remarks(summarise(rows)) if line.startswith("warning")]
    assert line.startswith("warning: dls:gain=0.8 loses the path of panda-circle where commands come later")
