"""Agents from files as policies: the contract, the scenarios that they play, and the agents of the package."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.files import agent_of, save_agent
from baselines.agents.policy import Agent
from baselines.agents.track import Track
from baselines.episodes import rollout
from baselines.evaluate import evaluate
from baselines.files import ResultsError
from baselines.policy import Problem
from baselines.registry import parse_policy
from ikgym.exceptions import InvalidInputError
from tests.baselines.random_agents import AHEAD, OFFSETS, network, random_agent, write_agent
from tests.comparison import identical

STEPS = 6
FAST = ikgym.scenarios.get("varga7-fast").replace(steps=STEPS)
RANDOM = ikgym.scenarios.get("varga7-random").replace(steps=STEPS)
WHOLE = ikgym.scenarios.get("varga7-pose-random").replace(steps=STEPS)
PANDA = ikgym.scenarios.get("panda-random").replace(steps=STEPS)
KINDS = {
    "track": Track(AHEAD),
    "bilinear": Bilinear(OFFSETS, interval=2),
}
contract = pytest.mark.parametrize("processing", KINDS.values(), ids=KINDS)


@pytest.fixture
def file(tmp_path):
    return write_agent(tmp_path / "mine.safetensors", FAST)


def agent_on(scenario, processing=None, trained_on=None, **parameters):
    given = random_agent(trained_on or scenario, processing=processing)
    return Agent(Problem.of(scenario), given=given, **parameters)


def observations(scenario, preview, rows, seed=0):
    """Observations on and off the nominal path."""
    envs = gym.make_vec("RedundantIK-v0", num_envs=rows, scenario=scenario, preview=preview)
    envs.reset(seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(STEPS - 1):
        actions = rng.uniform(-0.05, 0.05, envs.action_space.shape).astype(np.float32)
        yield envs.step(actions)[0]


def row(observation, i):
    return {key: value[i] for key, value in observation.items()}


@contract
def test_the_network_is_evaluated_at_intervals(processing):
    """Every third step after the start of an episode, row by row; with feedback in between."""
    every, third = (agent_on(WHOLE, processing, interval=steps) for steps in (1, 3))
    assert agent_on(WHOLE, processing).interval == processing.interval
    starts = [(True, True), (False, False), (False, True), (False, False), (False, False)]
    due = [(True, True), (False, False), (False, True), (True, False), (False, False)]
    state = None
    for observation, start, wanted in zip(observations(WHOLE, every.preview, 2), starts, due, strict=True):
        action, state = third.predict(observation, state, start)
        now, _ = every.predict(observation)
        assert [identical(*rows) for rows in zip(action, now, strict=True)] == list(wanted)


def test_previews():
    policy = agent_on(RANDOM)
    assert policy.preview == OFFSETS
    pairs = zip(observations(RANDOM, OFFSETS, 2), observations(RANDOM, 25, 2), strict=True)
    assert all(identical(policy.predict(some), policy.predict(every)) for some, every in pairs)
    with pytest.raises(InvalidInputError, match=r"agent needs to be shown the steps \(1, 2, 5, 20\) ahead"):
        policy.predict(next(observations(RANDOM, 3, 1)))


def test_scenarios_that_do_not_fit(tmp_path, file):
    for name, words in {"khan8-q1": "8 joints and 12", "zhang3-helix": "3 joints and 3"}.items():
        with pytest.raises(
            InvalidInputError, match=rf"Agent .* was trained for 7 joints and 6 .*; here there are {words}"
        ):
            baselines.make("agent", name, path=file)
    whole = write_agent(tmp_path / "whole.safetensors", WHOLE)
    with pytest.raises(InvalidInputError, match="trained for the arm varga7, which moves differently from panda"):
        baselines.make("agent", PANDA, path=whole)
    other = WHOLE.replace(model=WHOLE.model.replace(tool=WHOLE.model.tool + 1e-3))
    with pytest.raises(InvalidInputError, match="moves differently"):
        baselines.make("agent", other, path=whole)
    assert rollout(other, baselines.make("agent", other, path=whole, any_arm=True), 0)
    save_agent(tmp_path / "a.safetensors", agent_of(network((5, 7)), Track(AHEAD), FAST))
    with pytest.raises(InvalidInputError, match=r"from \d+ features to 7 outputs, got 5 and 7"):
        baselines.make("agent", FAST, path=str(tmp_path / "a.safetensors"))


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({"path": ""}, ResultsError, "path: expected the file of an agent"),
        ({"path": 5}, ResultsError, "path: expected the file of an agent, got 5"),
        ({"hash": "abc"}, InvalidInputError, "hash: expected .*, got 'abc'"),
        ({"any_arm": 1}, InvalidInputError, "any_arm: expected true or false"),
        ({"interval": 0}, InvalidInputError, "interval: expected a whole number of at least 1, got 0"),
    ],
)
def test_bad_parameters(file, parameters, error, message):
    with pytest.raises(error, match=message):
        baselines.make("agent", FAST, **{"path": file, **parameters})


def test_paths(file, monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    for path in (tmp_path / "mine.safetensors", "mine.safetensors", "~/mine.safetensors"):
        policy = baselines.make("agent", FAST, path=path)
        assert policy.parameters == {"path": str(path), "hash": policy.file.digits, "any_arm": False, "interval": 1}
        assert baselines.make("agent", FAST, **policy.parameters).parameters == policy.parameters
    assert parse_policy("agent:runs/lr=1e-3/a b.safetensors") == ("agent", {"path": "runs/lr=1e-3/a b.safetensors"})


def test_evaluation(file, tmp_path):
    """Rows hold the hash: another agent in the same file is another policy."""
    first = evaluate(RANDOM, f"agent:{file}", episodes=2, steps=STEPS)
    assert [row.parameters["hash"] for row in first] == [baselines.make("agent", FAST, path=file).hash] * 2
    write_agent(file, FAST, seed=1)
    second = evaluate(RANDOM, f"agent:{file}", episodes=2, steps=STEPS)
    assert first[0].parameters["hash"] != second[0].parameters["hash"]
    assert [row.total_cost for row in first] != [row.total_cost for row in second]


def test_the_agent_of_the_package():
    policy = baselines.make("agent_alone", RANDOM)
    assert policy.parameters == {"hash": policy.file.digits, "interval": 8}
    about = policy.file.about
    assert (about["training"]["method"], about["scenario"]["name"]) == ("apg", "varga7-random")
    with pytest.raises(InvalidInputError, match="hash: expected"):
        baselines.make("agent_alone", RANDOM, hash="0" * 12)
    with pytest.raises(InvalidInputError, match="was trained for the arm varga7"):
        baselines.make("agent_alone", PANDA)


def test_the_agent_of_an_environment_by_id_follows_another_panda():
    """It was trained at 100 Hz without limits of acceleration, and plays at 500 Hz with them."""
    policy = baselines.make("agent_track", "panda-random")
    assert policy.file.about["training"]["env"] == "ikgym/Track-v0"
    assert policy.preview == (5, 25)
    rows = evaluate("panda-random", "agent_track", episodes=4)
    assert 1e-4 < np.median([row.position_error_rms for row in rows]) < 5e-3
