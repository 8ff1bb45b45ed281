"""Agents beside solvers: the table is that of what was played."""

from __future__ import annotations

import json
import pathlib

import numpy as np
import pytest

import baselines
from baselines.episodes import rollouts
from baselines.evaluation.pages.claims import Comparison
from benchmarks import paired
from ikgym import scenarios
from ikgym.exceptions import UnknownNameError
from tests.baselines.evaluation.pages.builders import write_runs
from tests.baselines.random_agents import write_agent

DOCS = pathlib.Path(__file__).parents[2] / "docs"
PAGES = ("agents_gradients.md", "agents_rewards.md")


def test_plays_and_prints(tmp_path, capsys, monkeypatch):
    scenario = scenarios.get("varga7-pose-random").replace(steps=30)
    monkeypatch.setattr(paired.scenarios, "get", lambda name: {"varga7-pose-random": scenario}[name])
    write_runs(tmp_path / "runs", 2)
    for seed in (0, 1):
        write_agent(tmp_path / "runs" / f"seed-{seed}" / "agent.safetensors", scenario, "dls", seed=seed)
    file = tmp_path / "paired.json"
    paired.main(["--agents", str(tmp_path / "runs"), "--out", str(file), "--episodes", "3"])
    printed = capsys.readouterr().out.splitlines()
    content = json.loads(file.read_text())
    assert printed == paired.lines(content)
    assert np.shape(content["played"]["agents"]["costs"]) == (2, 3)
    costs = [
        float(np.sum(e.tracking_cost + e.velocity_cost))
        for e in rollouts(scenario, baselines.make("dls", scenario), scenarios.seeds("test", 3))
    ]
    np.testing.assert_allclose(content["played"]["dls"]["costs"][0], costs, rtol=1e-5)
    ratio = np.exp(np.mean(np.log(content["played"]["agents"]["costs"]) - np.log(costs)))
    assert float(printed[2].split("|")[2].split()[0]) == pytest.approx(ratio, rel=1e-3)
    paired.main(["--out", str(file)])
    assert capsys.readouterr().out.splitlines() == printed


def test_unknown_names_are_told(tmp_path):
    write_runs(tmp_path, 1)
    (tmp_path / "seed-0" / "agent.safetensors").write_bytes(b"")
    with pytest.raises(UnknownNameError, match="Did you mean 'dls'"):
        paired.main(["--agents", str(tmp_path), "--out", str(tmp_path / "x.json"), "--beside", "dlss"])


@pytest.mark.parametrize(
    ("file", "seeds", "episodes"),
    [
        ("agents_quick.json", 3, 256),
        ("agents.json", 5, 256),
        ("agents_skew.json", 5, 256),
        ("agents_more.json", 5, 1280),
        ("agents_long.json", 1, 256),
        ("agents_long_skew.json", 1, 256),
        ("agents_td3.json", 3, 256),
        ("agents_ppo_quick.json", 3, 256),
        ("agents_ppo.json", 5, 256),
        ("agents_ppo_more.json", 5, 1280),
    ],
)
def test_the_page_has_the_table_of_what_was_played(file, seeds, episodes):
    (page,) = (text for name in PAGES if f"<!-- beside {file} -->" in (text := (DOCS / name).read_text("utf-8")))
    table = page.split(f"<!-- beside {file} -->\n")[1].split("\n<!-- end -->")[0]
    content = json.loads((DOCS / file).read_text())
    assert table.splitlines() == paired.lines(content)
    assert (content["episodes"], content["split"]) == (episodes, "test")
    assert len(content["played"]["agents"]["costs"]) == seeds


@pytest.mark.parametrize(
    ("longer", "shorter"), [("agents.json", "agents_quick.json"), ("agents_long.json", "agents.json")]
)
def test_the_page_says_what_more_training_is_worth(longer, shorter):
    costs = (json.loads((DOCS / file).read_text())["played"]["agents"]["costs"] for file in (longer, shorter))
    page = " ".join((DOCS / "agents_gradients.md").read_text(encoding="utf-8").split())
    assert f"{Comparison.of(*map(np.array, costs))} times" in page


@pytest.mark.parametrize("file", ["README.md", "docs/agents_gradients.md"])
def test_pages_say_how_much_less_quick_agents_cost(file):
    played = json.loads((DOCS / "agents_quick.json").read_text())["played"]
    mean = {label: np.mean(np.log(one["costs"])) for label, one in played.items()}
    text = " ".join((DOCS.parent / file).read_text(encoding="utf-8").split())
    less = {label.split(":")[0]: 100.0 * -np.expm1(mean["agents"] - own) for label, own in mean.items()}
    assert f"cost {less['dls']:.0f} % less than tuned damped least squares" in text
    long = json.loads((DOCS / "agents_long.json").read_text())["played"]
    hour = np.mean(np.log(long["agents"]["costs"])) - np.mean(np.log(long["dls:gain=0.15,damping=0.01"]["costs"]))
    assert file != "README.md" or f"one of an hour {-100.0 * np.expm1(hour):.0f} % less" in text
    assert file == "README.md" or f"and {less['rhc']:.0f} % less than a receding horizon of 3" in text
