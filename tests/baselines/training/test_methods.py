"""The contract of apg: a segment depends on state and number alone, and a run can be killed and resumed."""

import time

import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

import baselines
from baselines.episodes import rollouts
from baselines.training.randomness import deterministic_torch
from baselines.training.run import train, weights_hash
from baselines.training.validation import validation_seeds
from tests.baselines.training.killing import run_until_done, run_with_kills
from tests.baselines.training.small import about, play_segments, timeless, tiny, trainer_of

CASES = {
    "plain": tiny(),
    "damped": tiny(damping=4e-4),
    "skew, end within a segment": tiny(task="skew", steps=20),
    "held for longer than it sees": tiny(offsets=(1, 2)),
}
#: Long enough to be killed meanwhile.
LONGER = {"segments": 8, "evaluate_every": 4}


@pytest.mark.parametrize("config", CASES.values(), ids=CASES)
def test_a_segment_depends_on_state_and_number(config, tmp_path):
    with deterministic_torch():
        undisturbed = trainer_of(config)
        before = weights_hash(undisturbed.policy)
        play_segments(undisturbed, [0])
        torch.save(undisturbed.state(), tmp_path / "state.pt")
        wanted = play_segments(undisturbed, [1, 2])
        other = trainer_of(config)
        other.restore(torch.load(tmp_path / "state.pt", weights_only=True))
        assert play_segments(other, [1, 2]) == wanted
    assert weights_hash(other.policy) == weights_hash(undisturbed.policy) != before
    assert other.steps == undisturbed.steps > 0


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A run from beginning to end."""
    folder, config = tmp_path_factory.mktemp("apg"), tiny()
    return config, folder, train(config, 3, folder)


def assert_same_run(folder, other):
    assert about(other)["weights_sha256"] == about(folder)["weights_sha256"]
    assert about(other)["kept"] == about(folder)["kept"]
    assert timeless(other) == timeless(folder)


def test_a_run_that_was_stopped_ends_like_one_that_was_not(finished, tmp_path):
    """Also if it was stopped some segments after its last checkpoint; TensorBoard has each step once."""
    config, folder, result = finished

    def stop(done, score):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(config, 3, tmp_path, checkpoint_every=1e9, on_segment=stop)
    assert about(tmp_path)["training"]["segments"] == 1  # the first one is written at once
    assert not (tmp_path / "agent.safetensors").exists()
    time.sleep(1.0)  # TensorBoard orders files by the second of their beginning
    assert train(config, 3, tmp_path, resume=True) == type(result)(tmp_path, result.weights_sha256, result.score)
    assert_same_run(folder, tmp_path)
    for each in (folder, tmp_path):
        events = EventAccumulator(str(each / "tensorboard")).Reload()
        steps = [row["steps"] for row in timeless(folder) if "validation" in row]
        assert [event.step for event in events.Scalars("validation/cost")] == steps


def test_run_json(finished):
    config, folder, result = finished
    content = about(folder)
    assert (content["status"], content["method"]) == ("finished", config.method)
    assert type(config).from_json(content["config"]) == config
    assert content["weights_sha256"] == result.weights_sha256
    assert content["training"]["segments"] == 3
    assert content["training"]["steps"] == timeless(folder)[-1]["steps"] > 0
    assert {"torch", "stable_baselines3", "numpy", "ikgym"} <= content["versions"].keys()
    assert [row["segment"] for row in content["validation"]] == [0, 2, 3]
    costs = [row["cost"] for row in content["validation"]]
    assert content["kept"]["segment"] == content["validation"][int(np.argmin(costs))]["segment"]
    assert content["kept"]["validation"]["cost"] == min(costs) == result.score.cost


def test_the_agent_plays_as_in_validation(finished):
    config, folder, result = finished
    scenario = config.make_scenario()
    policy = baselines.make("agent", scenario, path=str(folder / "agent.safetensors"))
    episodes = rollouts(scenario, policy, validation_seeds(scenario, config.validation_episodes))
    costs = [float(np.sum(e.tracking_cost + e.velocity_cost)) for e in episodes]
    assert np.exp(np.mean(np.log(costs))) == pytest.approx(result.score.cost, rel=1e-12)


def check_kills(kills, tmp_path, rng):
    """Kills runs at random moments until there were enough, and compares where they end."""
    config = tiny(**LONGER)
    duration = run_until_done(config, tmp_path / "undisturbed")
    killed = runs = 0
    while killed < kills:
        killed += run_with_kills(config, tmp_path / f"{runs}", kills - killed, duration, rng)
        assert_same_run(tmp_path / "undisturbed", tmp_path / f"{runs}")
        runs += 1


def test_killed_at_a_random_moment(tmp_path):
    check_kills(1, tmp_path, np.random.default_rng())


@pytest.mark.slow
def test_killed_at_several_moments(tmp_path):
    check_kills(4, tmp_path, np.random.default_rng())
