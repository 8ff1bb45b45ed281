"""The table of agents with memory is that of what was measured."""

from __future__ import annotations

import json
import pathlib

import pytest

from benchmarks import memory
from ikgym import scenarios
from tests.baselines.agents.recurrent.recurrent_agents import made

DOCS = pathlib.Path(__file__).parents[2] / "docs"


def test_the_page_shows_what_was_measured():
    measured = json.loads((DOCS / "memory.json").read_text())
    assert (measured["split"], measured["episodes"]) == ("test", 16)
    assert memory.table(measured) in (DOCS / "agents_memory.md").read_text()


def test_noise_seeds_of_an_episode_count_once():
    short = scenarios.get("panda-camera-slow").replace(steps=40)
    once = [memory.costs(short, made(scenario=short), [seed], 2)[0] for seed in (5, 6)]
    assert memory.costs(short, made(scenario=short), [5, 6], 2) == once


def test_what_is_known_is_not_measured_again(tmp_path, monkeypatch, capsys):
    out, asked = tmp_path / "memory.json", []
    monkeypatch.setattr(memory, "costs", lambda *given: asked.append(given[1]) or [2.0, 8.0])
    two = {"offset_free": "dls", f"{memory.MEMORY}, 0": "dls"}
    monkeypatch.setattr(memory, "policies", lambda *given: two)
    options = ["--plants", "panda-payload", "--split", "validation", "--episodes", "2", "--out", str(out)]
    memory.main(options)
    assert len(asked) == 2
    memory.main(options)
    assert len(asked) == 2
    assert "| **offset_free** | 4.000 | 2.000 … 8.000 | – | – |" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        memory.main([*options, "--episodes", "3"])


def test_filters_that_lose_every_episode_are_left_out():
    labels = {name: list(memory.policies(scenarios.get(name), ["a", "b"])) for name in memory.PLANTS}
    assert "offset_free" in labels["panda-payload"]
    assert "offset_free" not in labels["panda-field"]
    assert all(labels[name][-2:] == [f"{memory.MEMORY}, seed 0", f"{memory.MEMORY}, seed 1"] for name in labels)
