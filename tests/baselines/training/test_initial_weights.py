"""Models that begin from a trained one are that one, as far as both are of a kind."""

from __future__ import annotations

import base64
import json
import pathlib
import pickle
import zipfile

import numpy as np
import pytest
import torch
from safetensors.numpy import load, save

from baselines.agents.files import digest
from baselines.files import ResultsError
from baselines.training import checkpoint, methods
from baselines.training.errors import TrainingError
from baselines.training.randomness import reseed
from baselines.training.run import train
from baselines.training.trainers import model_file
from baselines.training.trainers.initial_weights import inherit
from baselines.training.trainers.models import network_outputs
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
    config = inherit(tiny(method, init=file, **{"scenario": "varga7-random", **changes}), ())
    reseed(0, None)
    return methods.get(method).make(config, config.make_scenario(), 0)


@pytest.mark.parametrize("suffix", ["model.safetensors", "agent.safetensors"])
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
    np.testing.assert_allclose(network_outputs(trainer.model, features), wanted, atol=1e-6)
    assert np.abs(wanted).max() > 1e-3
    fresh = tiny(method, scenario="varga7-random", **SHAPE)
    untrained = methods.get(method).make(fresh, fresh.make_scenario(), 0).model
    assert not np.allclose(network_outputs(untrained, features), wanted, atol=1e-4)
    if method == "td3" and (source, suffix) != ("td3", "model.safetensors"):  # which has its own, that lags behind
        target = trainer.model.policy.actor_target(torch.from_numpy(features)).detach().numpy()
        np.testing.assert_allclose(target, wanted, atol=1e-6)


@pytest.mark.parametrize("method", ["ppo", "sac", "td3"])
def test_critics_come_with_models_of_the_same_kind(sources, method):
    final = checkpoint.load(sources[method] / "checkpoint.pt").trainer["parameters"]["policy"]
    given = begun(method, sources[method] / "model.safetensors").state()["parameters"]["policy"]
    assert [name for name, tensor in final.items() if not given[name].equal(tensor)] == (
        ["log_std"] if method == "ppo" else []
    )
    of_agent = begun(method, sources[method] / "agent.safetensors").state()["parameters"]["policy"]
    critics = [name for name in final if "critic" in name or "value_net" in name]
    assert critics
    assert not any(of_agent[name].equal(final[name]) for name in critics if final[name].abs().sum() > 0)


def test_first_deviation_is_asked_for(sources):
    model = begun("ppo", sources["ppo"] / "model.safetensors", log_std_init=-4.5).model
    np.testing.assert_array_equal(model.policy.log_std.detach().numpy(), -4.5)


def test_what_is_seen_comes_with_the_file(sources):
    config = tiny("ppo", init=sources["ppo"] / "model.safetensors", scenario="varga7-random")
    settled = inherit(config, ())
    assert {name: getattr(settled, name) for name in SHAPE} == SHAPE
    assert inherit(config.replace(action_scale=0.3), ("action_scale",)) == settled
    for name, value in {"action_scale": 0.5, "hidden": (9, 9), "base_policy": "mfac", "null_space": 0.2}.items():
        with pytest.raises(TrainingError, match=f"{name}: .*model.safetensors has .*, got .*: leave it out"):
            inherit(config.replace(**{name: value}), (name,))
    assert inherit(config.replace(init=None), ("action_scale",)).action_scale == config.action_scale


@pytest.mark.parametrize(("source", "method", "fitting"), [("ppo", "sac", "ppo"), ("sac", "ppo", "sac or td3")])
def test_another_squashing_is_another_agent(sources, source, method, fitting):
    with pytest.raises(TrainingError, match=rf"Go on with {fitting}, or imitate .* --algorithm {method}"):
        begun(method, sources[source] / "model.safetensors")


def test_agents_that_weigh_an_inverse_are_gone_on_with(tmp_path):
    """SAC goes on with TD3; a network of apg, whose outputs are not kept within ±1, is another agent."""
    inverse = {"output": "inverse", "damping": 1e-2, "hold": 2, "scenario": "panda-random"}
    apg = {"scenario": "panda-random", "task": "pose", "damping": 1e-2, "matrix": False, "offsets": (1, 2, 10)}
    for method, changes in (("td3", inverse), ("apg", apg)):
        train(tiny(method, **changes), 3, tmp_path / method)
    files = {method: tmp_path / method / "agent.safetensors" for method in ("td3", "apg")}
    trainer = begun("sac", files["td3"], **inverse)
    features = np.random.default_rng(0).normal(size=(20, trainer.model.observation_space.shape[0])).astype(np.float32)
    wanted = model_file.load_weights(files["td3"]).network.forward(features)
    np.testing.assert_allclose(network_outputs(trainer.model, features), wanted, atol=1e-6)
    with pytest.raises(TrainingError, match="td3 keeps network outputs within ±1 by tanh"):
        begun("td3", files["apg"], **inverse)
    with pytest.raises(TrainingError, match=r"apg does not keep network outputs within ±1.*Go on with sac or td3"):
        begun("apg", files["td3"], **apg)


def test_files_that_do_not_do(sources, tmp_path):
    with pytest.raises(ResultsError, match="does not exist"):
        begun("ppo", tmp_path / "none.safetensors")
    whole = (sources["ppo"] / "model.safetensors").read_bytes()
    for name, content in {"short": whole[:40], "cut": whole[:-4], "other": b"PK" + whole}.items():
        (tmp_path / f"{name}.safetensors").write_bytes(content)
        with pytest.raises((ResultsError, TrainingError), match=f"{name}.safetensors"):
            begun("ppo", tmp_path / f"{name}.safetensors")
    other = tiny("ppo", init=sources["ppo"] / "model.safetensors", **OVER)
    with pytest.raises(TrainingError, match="which is not that of this run"):
        train(other, 0, tmp_path / "run")


def test_weights_that_are_not_finite_or_of_another_shape_are_refused(sources, tmp_path):
    content = (sources["ppo"] / "model.safetensors").read_bytes()
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    text = header["__metadata__"][model_file.KEY]
    tensors = load(content)
    for name, value, message in [
        ("policy.log_std", np.full_like(tensors["policy.log_std"], np.nan), "expected finite weights"),
        ("policy.log_std", np.zeros(3, np.float32), "size mismatch for log_std"),
        ("policy.more", np.zeros(3, np.float32), "Unexpected key"),
    ]:
        file = tmp_path / "model.safetensors"
        forged, described = {**tensors, name: value}, json.loads(text)
        del described["hash"]
        described["hash"] = digest(sorted(forged.items()), described)
        file.write_bytes(save(forged, {model_file.KEY: json.dumps(described)}))
        with pytest.raises(TrainingError, match=f"Cannot begin from .*{message}"):
            begun("ppo", file)


def test_changed_weights_are_noticed(sources, tmp_path):
    """A flipped bit of a weight is a weight, too: only the hash tells."""
    content = bytearray((sources["ppo"] / "model.safetensors").read_bytes())
    content[-3] ^= 1
    (tmp_path / "model.safetensors").write_bytes(content)
    with pytest.raises(TrainingError, match="was changed after it was written: expected the hash"):
        begun("ppo", tmp_path / "model.safetensors")


def test_zips_are_never_loaded(sources, tmp_path):
    """Stable-Baselines3 unpickles what is in them, and a file from elsewhere could run code."""

    class Evil:
        def __reduce__(self):
            return pathlib.Path.touch, (tmp_path / "ran",)

    with zipfile.ZipFile(tmp_path / "model.zip", "w") as archive:
        archive.writestr(
            "data", json.dumps({"policy_class": {":serialized:": base64.b64encode(pickle.dumps(Evil())).decode()}})
        )
        archive.writestr("policy.pth", pickle.dumps(Evil()))
    for file in (tmp_path / "model.zip", sources["ppo"] / "model.zip"):
        with pytest.raises(TrainingError, match=r"can run code .* Begin from the model\.safetensors"):
            begun("ppo", file)
    # Whatever a file is called.
    (tmp_path / "model.safetensors").write_bytes((tmp_path / "model.zip").read_bytes())
    with pytest.raises(ResultsError, match=r"no safetensors file|damaged"):
        begun("ppo", tmp_path / "model.safetensors")
    assert not (tmp_path / "ran").exists()


def test_a_changed_file_is_not_gone_on_with(sources, tmp_path):
    file = tmp_path / "model.safetensors"
    file.write_bytes((sources["ppo"] / "model.safetensors").read_bytes())
    config = inherit(tiny("ppo", init=file, scenario="varga7-random"), ())
    train(config, 0, tmp_path / "run")
    assert about(tmp_path / "run")["init"]["file"] == str(file)
    train(tiny("ppo", **{**OVER, **SHAPE}), 5, tmp_path / "other")
    file.write_bytes((tmp_path / "other" / "model.safetensors").read_bytes())
    with pytest.raises(TrainingError, match="another init: sha256"):
        train(config, 0, tmp_path / "run", resume=True)


def test_fine_tuning_begins_where_the_file_ends(sources, tmp_path):
    """With little noise and critics that warm up first, the validation does not explode."""
    config = inherit(
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
