"""Agents without some of their outputs: each kind is left out, and the table is that of what was played."""

from __future__ import annotations

import json
import pathlib

import numpy as np
import pytest

import baselines
from baselines.agents.bilinear.damped_kernels import with_matrix
from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.files import save_agent
from baselines.episodes import rollouts
from baselines.evaluation.pages.claims import Comparison
from baselines.policy import Problem
from benchmarks import outputs
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from tests.baselines.random_agents import network, write_agent

DOCS = pathlib.Path(__file__).parents[2] / "docs"
SCENARIO = scenarios.get("varga7-pose-random").replace(steps=20)


def written(file, seed=0, **inverse):
    processing, problem = Bilinear((1, 10, 40), **inverse), Problem.of(SCENARIO)
    sizes = processing.size(problem), 8, processing.outputs(problem)
    made = network(sizes, squash="linear", seed=seed)
    save_agent(file, made, processing, SCENARIO)
    return made


def test_every_output_is_one_of_the_parts(tmp_path):
    """Those of h, λ and U are where the law puts them for a network without G; those of G are the others."""
    found = outputs.parts(7, 57)
    assert sorted(np.concatenate(list(found.values()))) == list(range(57))
    assert [len(found[name]) for name in "GhλU"] == [42, 7, 1, 7]
    assert found["h"].tolist() == [6, 13, 20, 27, 34, 41, 48]  # behind each row of G
    placed = with_matrix(6, np.arange(1.0, 16.0)[None])[0]
    assert placed[np.concatenate([found[name] for name in "hλU"])].tolist() == list(range(1, 16))
    assert not placed[found["G"]].any()
    made = written(tmp_path / "agent.safetensors", damping=1e-2)
    features = np.random.default_rng(0).normal(size=(3, made.inputs)).astype(np.float32)
    kept = outputs.keeping(made, found["h"]).forward(features)
    assert np.array_equal(kept[:, found["h"]], made.forward(features)[:, found["h"]])
    assert not np.delete(kept, found["h"], axis=1).any()


def test_plays_and_prints(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(outputs.scenarios, "get", lambda name: {"varga7-pose-random": SCENARIO}[name])
    agent, file = tmp_path / "agent.safetensors", tmp_path / "outputs.json"
    made = written(agent, damping=1e-2)
    outputs.main(["--agent", str(agent), "--out", str(file), "--episodes", "3"])
    printed = capsys.readouterr().out.splitlines()
    content = json.loads(file.read_text())
    assert printed == outputs.lines(content)
    assert list(content["played"]) == list(outputs.KEPT)
    nothing = tmp_path / "nothing.safetensors"
    save_agent(nothing, outputs.keeping(made, np.zeros(0, dtype=np.int64)), Bilinear((1, 10, 40), 1e-2), SCENARIO)
    for path, label in ((agent, "G, h, λ, U"), (nothing, "nothing")):
        episodes = rollouts(SCENARIO, baselines.make("agent", SCENARIO, path=str(path)), scenarios.seeds("test", 3))
        costs = [float(np.sum(e.tracking_cost + e.velocity_cost)) for e in episodes]
        np.testing.assert_allclose(content["played"][label]["costs"], costs, rtol=1e-5)
    whole, without = (np.array(content["played"][label]["costs"]) for label in ("G, h, λ, U", "h, λ, U"))
    ratio = np.exp(np.mean(np.log(without / whole)))
    assert float(printed[3].split("|")[2].split()[0]) == pytest.approx(ratio, rel=1e-3)
    assert ratio != 1.0


@pytest.mark.parametrize("inverse", [{}, {"damping": 1e-2, "matrix": False}, None])
def test_other_agents_are_refused(tmp_path, inverse):
    agent = tmp_path / "agent.safetensors"
    if inverse is None:
        write_agent(agent, SCENARIO)
    else:
        written(agent, **inverse)
    with pytest.raises(InvalidInputError, match="expected a bilinear one with a matrix beside an inverse"):
        outputs.main(["--agent", str(agent), "--out", str(tmp_path / "x.json")])
    assert not (tmp_path / "x.json").exists()


def test_the_page_has_the_table_of_what_was_played():
    page = (DOCS / "agents_gradients.md").read_text(encoding="utf-8")
    table = page.split("<!-- outputs -->\n")[1].split("\n<!-- end -->")[0]
    content = json.loads((DOCS / "agents_outputs.json").read_text())
    assert table.splitlines() == outputs.lines(content)
    assert (content["episodes"], content["split"]) == (256, "test")


def test_the_pages_say_how_much_is_learned():
    """Agents beside the networks that they could begin with, λ = 1e-2 and 4e-2, and these beside tuned dls."""

    def costs(file, label):
        one = json.loads((DOCS / file).read_text())["played"][label]["costs"]
        return np.atleast_2d(np.array(one))

    first = costs("agents_outputs.json", "nothing")
    second = costs("agents_ppo.json", "agent:runs/ppo-untrained/seed-0/agent.safetensors")
    solver = costs("agents_long.json", "dls:gain=0.15,damping=0.01")
    by_gradients, by_rewards = (
        " ".join((DOCS / name).read_text(encoding="utf-8").split())
        for name in ("agents_gradients.md", "agents_rewards.md")
    )
    pairs = [(first, solver), (second, solver)]
    pairs += [
        (costs(file, "agents"), other) for file in ("agents.json", "agents_long.json") for other in (first, second)
    ]
    for one, other in pairs:
        assert str(Comparison.of(one, other)) in by_gradients
    assert str(Comparison.of(*(costs("agents_td3.json", label) for label in ("agents", "nothing")))) in by_rewards
