"""Models of Stable-Baselines3 as agents: the same actions, and nothing run that nobody trusts."""

from __future__ import annotations

import base64
import contextlib
import io
import json
import os
import pickle
import subprocess
import sys
import tracemalloc
import zipfile

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import A2C, DDPG, PPO, SAC, TD3
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

import baselines
import ikgym
from baselines.agents import sb3_zip
from baselines.agents.features import Processing
from baselines.agents.files import load_agent
from baselines.agents.sb3_network import network_of
from baselines.agents.sb3_zip import export_model, save_zip
from baselines.episodes import rollout
from baselines.evaluate import evaluate
from baselines.files import ResultsError
from baselines.policy import Problem
from ikgym.exceptions import InvalidInputError
from tests.baselines.files.test_archives import lying_zip
from tests.baselines.random_agents import OFFSETS, write_agent
from tests.comparison import identical

SCENARIO = ikgym.scenarios.get("varga7-fast").replace(steps=6)
PROCESSING = Processing(offsets=OFFSETS, base_policy="dls:damping=1e-2")
ALGORITHMS = {"ppo": PPO, "a2c": A2C, "sac": SAC, "td3": TD3, "ddpg": DDPG}
ACTIVATIONS = {"relu": torch.nn.ReLU, "tanh": torch.nn.Tanh, "silu": torch.nn.SiLU, "elu": torch.nn.ELU}
PREVIEW = 3


class Features(gym.Env):
    """Spaces of an agent's training: flat features, and a box of joint velocities."""

    observation_space = gym.spaces.Box(-np.inf, np.inf, (PROCESSING.size(Problem.of(SCENARIO)),), np.float32)
    action_space = gym.spaces.Box(-1.0, 1.0, (7,), np.float32)

    def reset(self, *, seed=None, options=None):
        return self.observation_space.sample(), {}


def model_of(algorithm="ppo", activation=None, env=None, kind=None, *, seed=0, **options):
    """A model with random numbers, some of whose answers leave the box."""
    env = Features() if env is None else env
    kwargs = {"net_arch": [16, 12], **options.pop("policy_kwargs", {})}
    if activation is not None:
        kwargs["activation_fn"] = ACTIVATIONS[activation]
    small = {"n_steps": 4} if algorithm in ("ppo", "a2c") else {"buffer_size": 10}
    small |= {"batch_size": 4} if algorithm == "ppo" else {}
    kind = kind or ("MultiInputPolicy" if isinstance(env.observation_space, gym.spaces.Dict) else "MlpPolicy")
    model = ALGORITHMS[algorithm](kind, env, policy_kwargs=kwargs, seed=seed, device="cpu", **small, **options)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.normal_(0.0, 0.4, generator=generator)
    return model


def environment(preview=PREVIEW, scenario=SCENARIO):
    return gym.make("RedundantIK-v0", scenario=scenario, preview=preview)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "model.zip"


def features(rows=40):
    return np.random.default_rng(0).normal(0.0, 2.0, (rows, Features.observation_space.shape[0])).astype(np.float32)


def agent(file, scenario=SCENARIO, *, trust=True, **options):
    return baselines.make("agent", scenario, path=str(file), trust=trust, **options)


def played(env, policy):
    """Observations of an episode, and a policy's actions."""
    observation, _ = env.reset(seed=0)
    for _ in range(SCENARIO.steps):
        action, _ = policy.predict(observation)
        yield observation, action
        observation, *_ = env.step(action)


class TestSameActions:
    @pytest.mark.parametrize("activation", [None, *ACTIVATIONS])
    @pytest.mark.parametrize("algorithm", ALGORITHMS)
    def test_on_features(self, file, algorithm, activation):
        model = model_of(algorithm, activation)
        save_zip(model, file, PROCESSING, SCENARIO)
        policy = agent(file)
        expected, _ = model.predict(features(), deterministic=True)
        np.testing.assert_allclose(policy.file.network.forward(features()), expected, atol=1e-5)
        assert np.ptp(expected) > 0.5
        assert policy.preview == OFFSETS
        assert policy.inner.name == "dls"
        assert rollout(SCENARIO, policy, 0).q.shape == (6, 7)
        exported = file.with_suffix(".safetensors")
        digest = export_model(model, exported, PROCESSING, SCENARIO, {"method": algorithm})
        assert load_agent(exported).hash == digest
        np.testing.assert_allclose(load_agent(exported).network.forward(features()), expected, atol=1e-5)
        np.testing.assert_allclose(rollout(SCENARIO, agent(exported), 0).q, rollout(SCENARIO, policy, 0).q, atol=1e-6)

    @pytest.mark.parametrize("algorithm", ALGORITHMS)
    def test_on_the_observation_itself(self, file, algorithm):
        model = model_of(algorithm, env=environment())
        model.save(file)
        policy = agent(file)
        assert policy.preview == (1, 2, 3)
        for observation, action in played(environment(), policy):
            np.testing.assert_allclose(action, model.predict(observation, deterministic=True)[0], atol=1e-5)
        assert agent(file, offsets=(1, 4, 9)).preview == (1, 4, 9)

    def test_on_the_flat_observation(self, file):
        env = gym.wrappers.FlattenObservation(environment())
        model = model_of("sac", env=env)
        model.save(file)
        for observation, action in played(environment(), agent(file)):
            flat = gym.spaces.flatten(environment().observation_space, observation)
            np.testing.assert_allclose(action, model.predict(flat, deterministic=True)[0], atol=1e-5)

    @pytest.mark.parametrize("algorithm", ["ppo", "sac", "td3"])
    def test_without_hidden_layers(self, file, algorithm):
        model = model_of(algorithm, policy_kwargs={"net_arch": []})
        export_model(model, file.with_suffix(".safetensors"), PROCESSING, SCENARIO)
        net = load_agent(file.with_suffix(".safetensors")).network
        assert net.sizes == (features().shape[1], 7)
        np.testing.assert_allclose(net.forward(features()), model.predict(features(), deterministic=True)[0], atol=1e-5)

    @pytest.mark.parametrize("algorithm", ["ppo", "sac"])
    def test_exported_as_trusted(self, file, algorithm):
        model = model_of(algorithm)
        save_zip(model, file, PROCESSING, SCENARIO)
        export_model(model, file.with_suffix(".safetensors"), PROCESSING, SCENARIO)
        ours, theirs = agent(file.with_suffix(".safetensors"), trust=False), agent(file)
        assert isinstance(theirs.file.network, sb3_zip.TrustedModel)
        assert theirs.preview == ours.preview
        for observation, action in played(environment(ours.preview), ours):
            np.testing.assert_allclose(theirs.predict(observation)[0], action, atol=1e-5)
            batch = {key: np.stack([value, 0.5 * value]) for key, value in observation.items()}
            assert identical(theirs.predict(batch)[0][0], theirs.predict(observation)[0])

    def test_what_is_no_plain_perceptron(self, file):
        model_of("sac", env=environment(), use_sde=True).save(file)
        policy = agent(file)
        model = SAC.load(file)
        for observation, action in played(environment(), policy):
            np.testing.assert_allclose(action, model.predict(observation, deterministic=True)[0], atol=1e-6)

    def test_stable_baselines3_reads_what_save_zip_writes(self, file):
        model = model_of("td3", "silu")
        save_zip(model, file, PROCESSING, SCENARIO)
        again = TD3.load(file, device="cpu")
        assert identical(*(m.predict(features(), deterministic=True)[0] for m in (again, model)))
        assert [path.name for path in file.parent.iterdir()] == ["model.zip"]


class Loaded:
    """What a model may have for a policy, once it is trusted."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (5,), np.float32)
    action_space = gym.spaces.Box(-1.0, 1.0, (2,), np.float32)
    action, state = np.zeros(2, dtype=np.float32), None

    def predict(self, observation, deterministic):
        assert deterministic
        return self.action, self.state


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"state": (np.zeros(3),)}, "expected a model without a memory"),
        ({"action": np.zeros(3, dtype=np.float32)}, "expected a model without a memory, whose actions are numbers"),
        ({"action": np.zeros(2, dtype=np.int64)}, "whose actions are numbers"),
        ({"action_space": gym.spaces.Discrete(3)}, "expected boxes, got"),
        ({"observation_space": gym.spaces.MultiBinary(5)}, "expected boxes, got"),
        ({"observation_space": gym.spaces.Dict({"q": Loaded.observation_space})}, r"of the parts .* got \('q',\)"),
    ],
)
def test_models_that_are_no_agents_though_trusted(changes, message):
    model = sb3_zip.TrustedModel(Loaded())
    assert (model.inputs, model.outputs) == (5, 2)
    with pytest.raises(InvalidInputError, match=message):
        sb3_zip.TrustedModel(type("Other", (Loaded,), changes)())


class TestEvaluation:
    def test_rows(self, file):
        model_of(env=environment()).save(file)
        rows = evaluate("varga7-fast", f"agent:path={file},trust=True", steps=5)
        rows += evaluate("varga7-fast", f"agent:{file}", steps=5, trust=True)
        assert [row.parameters["trust"] for row in rows] == [True, True]
        assert rows[0].parameters["hash"] == rows[1].parameters["hash"]
        assert [row.preview for row in rows] == [3, 3]
        assert rows[0].total_cost == rows[1].total_cost

    def test_what_needs_trust_says_so(self, file):
        model_of("sac", env=environment(), use_sde=True).save(file)
        with pytest.raises(ResultsError, match=r"may run code of its own .* With --trust, or trust=True, it is loaded"):
            evaluate("varga7-fast", ["dls", f"agent:{file}"], steps=5)
        assert evaluate("varga7-fast", f"agent:{file}", steps=5, trust=True)

    def test_other_arms(self, file):
        model_of(env=environment()).save(file)
        with pytest.raises(InvalidInputError, match="which do not add up to the model's 39 inputs"):
            agent(file, "khan8-q1")
        save_zip(model_of(), file, PROCESSING, SCENARIO)
        with pytest.raises(InvalidInputError, match="was trained for 7 joints"):
            agent(file, "khan8-q1")

    def test_offsets(self, file):
        model_of(env=environment()).save(file)
        for offsets, message in {(1, 2): "expected 3, as many", (3, 2, 1): "rising", "x": "rising"}.items():
            with pytest.raises(InvalidInputError, match=message):
                agent(file, offsets=offsets)
        save_zip(model_of(), file, PROCESSING, SCENARIO)
        with pytest.raises(InvalidInputError, match=r"offsets: .* says itself what it sees"):
            agent(file, offsets=(1, 2, 3))


class Doubling(BaseFeaturesExtractor):
    """Leaves no tensor behind, but is no flat observation."""

    def __init__(self, observation_space):
        super().__init__(observation_space, observation_space.shape[0])

    def forward(self, observations):
        return 2.0 * observations


class Scaled(gym.ActionWrapper):
    """Another box of actions."""

    def __init__(self, env):
        super().__init__(env)
        self.action_space = gym.spaces.Box(-2.0, 2.0, (7,), np.float32)


class TestWhatIsRefused:
    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (lambda: model_of(policy_kwargs={"features_extractor_class": Doubling}), "no extractor of features of its"),
            (lambda: model_of(policy_kwargs={"activation_fn": torch.nn.GELU}), "activation_fn: expected one of"),
            (lambda: model_of(policy_kwargs={"squash_output": True}, use_sde=True), r"got \['squash_output'\]"),
            (lambda: model_of("sac", use_sde=True), "expected the tensors of a multi-layer perceptron"),
            (lambda: model_of(env=Scaled(Features())), "make up another network than the one that acts"),
        ],
    )
    def test_models_with_more_to_them(self, file, make, message):
        with pytest.raises(InvalidInputError, match=message):
            export_model(make(), file, PROCESSING, SCENARIO)
        assert not file.exists()

    @pytest.mark.parametrize(
        ("spoil", "message"),
        [
            (lambda s: s.pop("action_net.bias"), "expected the tensors of"),
            (lambda s: s.update({"lstm_actor.weight": np.ones(3)}), "expected the tensors of"),
            (lambda s: s.update({"features_extractor.linear.weight": np.ones(3)}), "expected the tensors of"),
            (lambda s: s.clear(), "got none"),
            (
                lambda s: s.update({f"mlp_extractor.policy_net.3.{k}": np.ones(3) for k in ("weight", "bias")}),
                r"an activation behind each, got the numbers \[0, 2, 3\]",
            ),
            (lambda s: s.update({"action_net.weight": np.ones((7, 5))}), "weights of layer 2: expected shape"),
            (lambda s: s.update({"action_net.weight": np.full((7, 12), np.nan)}), "expected finite"),
        ],
    )
    def test_states(self, spoil, message):
        state = {name: tensor.numpy() for name, tensor in model_of().policy.state_dict().items()}
        assert network_of(state, {}).outputs == 7
        spoil(state)
        with pytest.raises(InvalidInputError, match=message):
            network_of(state, {})

    def test_exports(self, file):
        size = features().shape[1]
        with pytest.raises(InvalidInputError, match=f"expected one from {size} features to 7 joints, got 39 and 7"):
            export_model(model_of(env=environment()), file, PROCESSING, SCENARIO)
        assert not file.exists()


def rewritten(file, **members):
    """The archive with members replaced or added."""
    with zipfile.ZipFile(file) as archive:
        old = {info.filename: archive.read(info) for info in archive.infolist()}
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in {**old, **members}.items():
            if content is not None:
                archive.writestr(name, content)


class Bomb:
    """Makes a folder when it is unpickled."""

    def __init__(self, mark):
        self.mark = str(mark)

    def __reduce__(self):
        return os.makedirs, (self.mark, 0o777, True)


def serialised(bomb, data):
    """The JSON of a model in which everything serialised is a bomb."""
    text = base64.b64encode(pickle.dumps(bomb)).decode()
    spoilt = {
        name: {**value, ":serialized:": text} if isinstance(value, dict) and ":serialized:" in value else value
        for name, value in json.loads(data).items()
    }
    return json.dumps({**spoilt, "more": {":type:": "<class 'x'>", ":serialized:": text}}).encode()


def torch_saved(thing):
    content = io.BytesIO()
    torch.save(thing, content)
    return content.getvalue()


class TestMalice:
    @pytest.fixture
    def mark(self, tmp_path):
        return tmp_path / "executed"

    @pytest.fixture(params=["in data", "as policy.pth", "saved in policy.pth", "in variables", "everywhere"])
    def evil(self, request, file, mark):
        save_zip(model_of(), file, PROCESSING, SCENARIO)
        with zipfile.ZipFile(file) as archive:
            data = archive.read("data")
        bomb = Bomb(mark)
        places = {
            "in data": {"data": serialised(bomb, data)},
            "as policy.pth": {"policy.pth": pickle.dumps(bomb)},
            "saved in policy.pth": {"policy.pth": torch_saved({"action_net.weight": bomb})},
            "in variables": {"pytorch_variables.pth": torch_saved(bomb), "system_info.txt": pickle.dumps(bomb)},
        }
        chosen = places.get(request.param) or {k: v for place in places.values() for k, v in place.items()}
        rewritten(file, **chosen)
        return request.param

    def test_nothing_runs_without_trust(self, evil, file, mark):
        with pytest.raises(ResultsError, match=r"may run code of its own .*safe format .* \.safetensors.*export_model"):
            agent(file, trust=False)
        assert not mark.exists()

    def test_evaluation_runs_nothing(self, evil, file, mark):
        with pytest.raises(ResultsError, match="may run code of its own"):
            evaluate("varga7-fast", f"agent:{file}", steps=2)
        assert not mark.exists()

    def test_the_bomb_would_go_off(self, file, mark):
        """Else the tests above would show nothing."""
        pickle.loads(pickle.dumps(Bomb(mark)))
        assert mark.exists()
        mark.rmdir()
        model_of(env=environment()).save(file)
        with zipfile.ZipFile(file) as archive:
            data = archive.read("data")
        rewritten(file, data=serialised(Bomb(mark), data))
        with pytest.raises(ResultsError, match="may run code of its own"):
            agent(file, trust=False)
        assert not mark.exists()
        with pytest.raises(ResultsError, match="cannot be loaded by Stable-Baselines3"):
            agent(file)
        assert mark.exists()

    def test_trust_is_nothing_but_true(self, file, mark):
        model_of(env=environment()).save(file)
        for trust in (1, "True", None):
            with pytest.raises(InvalidInputError, match="trust: expected True or False"):
                agent(file, trust=trust)
        with pytest.raises(ResultsError, match="may run code of its own"):
            sb3_zip.load_zip(file, Problem.of(SCENARIO))

    @pytest.mark.parametrize(
        "base_policy",
        [
            "agent:path={zip},trust=True",
            "smoothed:policy=agent,options={{'path': '{zip}', 'trust': True}}",
            "smoothed:policy=smoothed,options={{'policy': 'agent', 'options': {{'path': '{zip}', 'trust': True}}}}",
        ],
    )
    def test_no_agent_can_call_for_another_that_is_trusted(self, file, mark, tmp_path, base_policy):
        model_of(env=environment()).save(file)
        with zipfile.ZipFile(file) as archive:
            data = archive.read("data")
        rewritten(file, data=serialised(Bomb(mark), data))
        path = write_agent(tmp_path / "a.safetensors", SCENARIO, base_policy.format(zip=file))
        for trust in (False, True):
            with pytest.raises(ResultsError, match="expected a policy that is no agent and is not made from one"):
                baselines.make("agent", SCENARIO, path=path, trust=trust)
        assert not mark.exists()

    @pytest.mark.parametrize(
        ("members", "message"),
        [
            ({"data": None}, "cannot be loaded by Stable-Baselines3: ValueError: it holds no policy"),
            ({"policy.pth": None}, "cannot be loaded by Stable-Baselines3: ValueError: it holds no policy"),
            ({"data": b"[]"}, "cannot be loaded by Stable-Baselines3"),
            ({"data": b"{"}, "cannot be loaded by Stable-Baselines3"),
            ({"data": b"{}"}, "cannot be loaded by Stable-Baselines3"),
            ({"data": b"[" * 100_000}, "cannot be loaded by Stable-Baselines3"),
            ({"ikgym.json": b"{}"}, "of another version: expected format 2, got None"),
            ({"ikgym.json": b'{"format": 1}'}, "of another version: expected format 2, got 1, which ikgym 0.1.0 reads"),
            ({"ikgym.json": b'{"format": 2}'}, "the key 'processing' is missing"),
            ({"ikgym.json": b"[" * 100_000}, "is damaged"),
            ({"ikgym.json": b"\xff"}, "is damaged"),
        ],
    )
    def test_archives(self, file, members, message):
        save_zip(model_of(), file, PROCESSING, SCENARIO)
        rewritten(file, **members)
        with pytest.raises(ResultsError, match=rf"Agent {file} .*{message}"):
            agent(file)

    def test_no_archive(self, file):
        for content in (b"", b"PK\x05\x06", pickle.dumps(3), b"\x93NUMPY"):
            file.write_bytes(content)
            with pytest.raises(ResultsError, match=r"is damaged, or no \.zip file"):
                agent(file)
        save_zip(model_of(), file, PROCESSING, SCENARIO)
        whole = file.read_bytes()
        for length in (10, len(whole) // 2, len(whole) - 5):
            file.write_bytes(whole[:length])
            with pytest.raises(ResultsError, match=r"is damaged, or no \.zip file|it holds no policy"):
                agent(file)
        for trust in (False, True):
            with pytest.raises(ResultsError, match=r"does not exist\. Did you mean '.*model\.zip'"):
                agent(file.with_name("modl.zip"), trust=trust)

    @pytest.mark.parametrize("packed", [True, False])
    def test_members_that_are_damaged(self, file, packed):
        """Whatever is flipped: an error of ours, or an agent."""
        save_zip(model_of(), file, PROCESSING, SCENARIO)
        if packed:
            rewritten(file)
        whole = file.read_bytes()
        rng = np.random.default_rng(0)
        for place in rng.integers(len(whole), size=60).tolist():
            spoilt = bytearray(whole)
            spoilt[place] ^= 0xFF
            file.write_bytes(spoilt)
            with contextlib.suppress(ResultsError, InvalidInputError):
                agent(file)


def test_agents_of_ours_need_no_torch(tmp_path):
    path = write_agent(tmp_path / "a.safetensors", SCENARIO, "dls")
    (tmp_path / "a.zip").write_bytes(b"")
    code = (
        "import sys; sys.modules['torch'] = sys.modules['stable_baselines3'] = None\n"
        "import baselines, ikgym\n"
        "from baselines.evaluate import evaluate\n"
        f"assert evaluate('varga7-fast', 'agent:{path}', steps=3)\n"
        "try:\n"
        f"    baselines.make('agent', 'varga7-fast', path={str(tmp_path / 'a.zip')!r}, trust=True)\n"
        "except ikgym.exceptions.MissingDependencyError as e:\n"
        "    print(e)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "need Stable-Baselines3: pip install" in done.stdout, done.stderr


def test_a_zip_that_lies_of_its_size_costs_no_memory(tmp_path):
    """Trust is no reason to unpack gigabytes."""
    (tmp_path / "bomb.zip").write_bytes(lying_zip())
    tracemalloc.start()
    try:
        with pytest.raises(ResultsError, match=r"is damaged, or no \.zip file"):
            agent(tmp_path / "bomb.zip")
        assert tracemalloc.get_traced_memory()[1] < 2**26
    finally:
        tracemalloc.stop()
