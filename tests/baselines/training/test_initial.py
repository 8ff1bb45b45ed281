"""Models that begin from a trained one are that one, as far as both are of a kind."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from baselines.files import ResultsError
from baselines.training import methods
from baselines.training.errors import TrainingError
from baselines.training.randomness import reseed
from baselines.training.run import train
from baselines.training.trainers.initial import settle
from baselines.training.trainers.models import answers
from ikgym.sb3 import RedundantIKVecEnv
from tests.baselines.training.small import OVER, about, tiny

SHAPE = {
    "hidden": (9, 7),
    "activation": "elu",
    "action_scale": 0.3,
    "base_policy": "dls",
    "null_space": 0.1,
    "offsets": (1, 5),
}


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """A run of each method, with a shape of its own."""
    out = {}
    for method in ("ppo", "sac", "td3"):
        out[method] = tmp_path_factory.mktemp(method)
        train(tiny(method, **{**OVER, **SHAPE}, keep_best=False), 3, out[method])
    return out


def begun(method, file, **changes):
    config = settle(tiny(method, init=file, scenario="varga7-random", **changes), ())
    reseed(0, None)
    return methods.get(method).make(config, config.make_scenario(), 0)


@pytest.mark.parametrize("suffix", ["model.zip", "agent.safetensors"])
@pytest.mark.parametrize(
    ("source", "method"), [("ppo", "ppo"), ("sac", "sac"), ("td3", "td3"), ("sac", "td3"), ("td3", "sac")]
)
def test_actors_are_the_same(sources, source, method, suffix):
    file = sources[source] / suffix
    trainer = begun(method, file)
    assert trainer.processing.to_json() == about(sources[source])["processing"]
    original = begun(source, file).model
    features = np.random.default_rng(0).normal(0.0, 3.0, (20, original.observation_space.shape[0])).astype(np.float32)
    wanted = original.predict(features, deterministic=True)[0]
    np.testing.assert_allclose(answers(trainer.model, features), wanted, atol=1e-6)
    assert np.abs(wanted).max() > 1e-3
    fresh = tiny(method, scenario="varga7-random", **SHAPE)
    untrained = methods.get(method).make(fresh, fresh.make_scenario(), 0).model
    assert not np.allclose(answers(untrained, features), wanted, atol=1e-4)
    if method == "td3" and (source, suffix) != ("td3", "model.zip"):  # which has its own, that lags behind
        target = trainer.model.policy.actor_target(torch.from_numpy(features)).detach().numpy()
        np.testing.assert_allclose(target, wanted, atol=1e-6)


@pytest.mark.parametrize("method", ["ppo", "sac", "td3"])
def test_critics_come_with_models_of_the_same_kind(sources, method):
    final = torch.load(sources[method] / "checkpoint.pt", weights_only=True)["trainer"]["parameters"]["policy"]
    given = begun(method, sources[method] / "model.zip").state()["parameters"]["policy"]
    assert [name for name, tensor in final.items() if not given[name].equal(tensor)] == (
        ["log_std"] if method == "ppo" else []
    )
    of_agent = begun(method, sources[method] / "agent.safetensors").state()["parameters"]["policy"]
    critics = [name for name in final if "critic" in name or "value_net" in name]
    assert critics
    assert not any(of_agent[name].equal(final[name]) for name in critics if final[name].abs().sum() > 0)


def test_first_deviation_is_asked_for(sources):
    model = begun("ppo", sources["ppo"] / "model.zip", log_std_init=-4.5).model
    np.testing.assert_array_equal(model.policy.log_std.detach().numpy(), -4.5)


def test_what_is_seen_comes_with_the_file(sources):
    config = tiny("ppo", init=sources["ppo"] / "model.zip", scenario="varga7-random")
    settled = settle(config, ())
    assert {name: getattr(settled, name) for name in SHAPE} == SHAPE
    assert settle(config.replace(action_scale=0.3), ("action_scale",)) == settled
    for name, value in {"action_scale": 0.5, "hidden": (9, 9), "base_policy": "mfac", "null_space": 0.2}.items():
        with pytest.raises(TrainingError, match=f"{name}: .*model.zip has .*, got .*: leave it out"):
            settle(config.replace(**{name: value}), (name,))
    assert settle(config.replace(init=None), ("action_scale",)).action_scale == config.action_scale


@pytest.mark.parametrize(("source", "method", "fitting"), [("ppo", "sac", "ppo"), ("sac", "ppo", "sac or td3")])
def test_another_squashing_is_another_agent(sources, source, method, fitting):
    with pytest.raises(TrainingError, match=rf"Go on with {fitting}, or imitate .* --algorithm {method}"):
        begun(method, sources[source] / "model.zip")


def test_files_that_do_not_do(sources, tmp_path):
    with pytest.raises(ResultsError, match="does not exist"):
        begun("ppo", tmp_path / "none.zip")
    (tmp_path / "damaged.zip").write_bytes(b"PK")
    with pytest.raises(ResultsError, match="damaged"):
        begun("ppo", tmp_path / "damaged.zip")
    env = RedundantIKVecEnv(2, "varga7-random")
    PPO("MultiInputPolicy", env, n_steps=4, batch_size=8, device="cpu").save(tmp_path / "raw.zip")
    with pytest.raises(TrainingError, match="no model that was trained here"):
        begun("ppo", tmp_path / "raw.zip")
    other = tiny("ppo", init=sources["ppo"] / "model.zip", **OVER)
    with pytest.raises(TrainingError, match="which is not that of this run"):
        train(other, 0, tmp_path / "run")


def test_a_changed_file_is_not_gone_on_with(sources, tmp_path):
    file = tmp_path / "model.zip"
    file.write_bytes((sources["ppo"] / "model.zip").read_bytes())
    config = settle(tiny("ppo", init=file, scenario="varga7-random"), ())
    train(config, 0, tmp_path / "run")
    assert about(tmp_path / "run")["init"]["file"] == str(file)
    train(tiny("ppo", **{**OVER, **SHAPE}), 5, tmp_path / "other")
    file.write_bytes((tmp_path / "other" / "model.zip").read_bytes())
    with pytest.raises(TrainingError, match="another init: sha256"):
        train(config, 0, tmp_path / "run", resume=True)


def test_fine_tuning_begins_where_the_file_ends(sources, tmp_path):
    """With little noise and critics that warm up first, the validation does not explode."""
    config = settle(
        tiny(
            "ppo",
            init=sources["ppo"] / "agent.safetensors",  # without critics
            scenario="varga7-random",
            evaluate_every=1,
            critic_warmup=2,
            segments=4,
            log_std_init=-5.0,
            learning_rate=1e-4,
        ),
        (),
    )
    train(config, 0, tmp_path)
    costs = [row["cost"] for row in about(tmp_path)["validation"]]
    assert costs[0] == pytest.approx(about(sources["ppo"])["kept"]["validation"]["cost"], rel=1e-4)
    assert costs[0] == costs[1] == costs[2] != costs[3]
    assert max(costs) < 1.05 * costs[0]
