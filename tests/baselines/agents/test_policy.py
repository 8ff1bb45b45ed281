"""Agents from files as policies: alone, over other policies, in evaluations, and as what the package ships."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import threading

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

import baselines
import ikgym
from baselines import registry
from baselines.agents import files, shipped
from baselines.agents.base_policy import make_base_policy
from baselines.agents.features import Processing
from baselines.agents.files import load_agent, save_agent
from baselines.agents.policy import Agent
from baselines.agents.recurrent.policy import SHIPPED
from baselines.episodes import rollout, rollouts
from baselines.evaluation.plan import make_plan
from baselines.files import ResultsError
from baselines.policy import Problem
from baselines.spec import parse_policy
from baselines.status import Status
from ikgym import parallel
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.random_agents import OFFSETS, network, write_agent
from tests.comparison import identical

STEPS = 6
FAST = ikgym.scenarios.get("varga7-fast").replace(steps=STEPS)
RANDOM = ikgym.scenarios.get("varga7-random").replace(steps=STEPS)
POSE = ikgym.tasks.get("pose")

# Base policies: none; with memory; that sees two steps; that counts in its memory; with much memory; a wrapper.
BASES = [None, "dls:gain=0.5", "rhc_gradient", "mfac", "rhc:horizon=3,iterations=1", "smoothed:policy=mfac"]
KINDS = [*((base_policy, None) for base_policy in BASES), ("dls", 1e-2)]
contract = pytest.mark.parametrize(("base_policy", "null_space"), KINDS)


@pytest.fixture
def file(tmp_path):
    return write_agent(tmp_path / "mine.safetensors", FAST, "dls:damping=1e-2")


def without(about, key):
    return {name: value for name, value in about.items() if name != key}


def agent_for(tmp_path, scenario, base_policy=None, **options):
    return baselines.make(
        "agent", scenario, path=write_agent(tmp_path / "a.safetensors", scenario, base_policy, **options)
    )


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


class TestContract:
    @contract
    def test_memory_is_that_of_the_base_policy_behind_its_own(self, tmp_path, base_policy, null_space):
        for on in (RANDOM.replace(task=POSE), RANDOM):  # the second has to resolve orientations
            if base_policy is not None and "mfac" in base_policy and on is RANDOM:
                continue
            path = write_agent(
                tmp_path / "a.safetensors", RANDOM.replace(task=POSE), base_policy, null_space=null_space
            )
            policy = baselines.make("agent", on, path=path)
            own, inside = policy.split(policy.memory(2))
            assert hasattr(own, "_fields") == (on is RANDOM)
            assert identical(inside, () if policy.inner is None else tuple(policy.inner.memory(2)))

    @contract
    def test_batch_equals_single_calls_and_memory_goes_by_rows(self, tmp_path, base_policy, null_space):
        for scenario in (RANDOM, ikgym.scenarios.get("khan8-q7q8").replace(steps=STEPS)):
            policy = agent_for(tmp_path, scenario, base_policy, null_space=null_space)
            states, batched = [None] * 3, None
            for k, observation in enumerate(observations(scenario, policy.preview, 3)):
                start = np.array([k == 0, k % 2 == 0, k in (0, 2)])
                action, batched = policy.predict(observation, state=batched, episode_start=start)
                assert action.dtype == np.float32
                for i in range(3):
                    single, states[i] = policy.predict(row(observation, i), None if start[i] else states[i], [False])
                    assert identical(single, action[i])
                    assert all(identical(a[0], b[i]) for a, b in zip(states[i], batched, strict=True))

    @contract
    def test_rows_that_are_shared_out_to_threads_are_the_same(self, monkeypatch, tmp_path, base_policy, null_space):
        policy = agent_for(tmp_path, RANDOM, base_policy, null_space=null_space)
        threads, solve = set(), Agent.solve

        def watched(self, batch, memory):
            threads.add(threading.get_ident())
            return solve(self, batch, memory)

        monkeypatch.setattr(Agent, "solve", watched)
        monkeypatch.setattr(parallel, "cores", lambda: 2)
        whole, shared = None, None
        for observation in observations(RANDOM, policy.preview, 5):
            monkeypatch.setattr(Agent, "grain", 100)
            expected, whole = policy.predict(observation, whole)
            monkeypatch.setattr(Agent, "grain", 1)
            action, shared = policy.predict(observation, shared)
            assert identical((action, shared), (expected, whole))
        assert len(threads) > 1

    @contract
    def test_actions_are_in_the_box_and_nothing_is_changed(self, tmp_path, base_policy, null_space):
        policy = agent_for(tmp_path, FAST, base_policy, null_space=null_space)
        space, state = ikgym.RedundantIKEnv(FAST).action_space, None
        for observation in observations(FAST, policy.preview, 1):
            before = {key: value.copy() for key, value in observation.items()}
            kept = None if state is None else tuple(array.copy() for array in state)
            action, after = policy.predict(row(observation, 0), state=state, deterministic=True)
            again, same = policy.predict(row(observation, 0), state=state, deterministic=False)
            assert action in space
            assert identical((action, after, observation), (again, same, before))
            assert state is None or identical(state, kept)
            assert policy.report(after).status[0] in set(Status)
            state = after

    def test_works_inside_evaluate_policy_with_several_environments(self, tmp_path):
        policy = agent_for(tmp_path, FAST, "dls")

        def make():
            return Monitor(gym.make("RedundantIK-v0", scenario=FAST, preview=policy.preview))

        several, lengths = evaluate_policy(policy, DummyVecEnv([make] * 3), 6, return_episode_rewards=True)
        alone, _ = evaluate_policy(policy, make(), 1, return_episode_rewards=True)
        assert lengths == [STEPS] * 6
        assert set(several) == set(alone)

    def test_together_as_alone(self, tmp_path):
        scenario = RANDOM.replace(steps=25, plant=ikgym.Plant(noise=0.1))
        policy = agent_for(tmp_path, scenario, "dls")
        seeds = [2_000_000, 7]
        for seed, episode in zip(seeds, rollouts(scenario, policy, seeds), strict=True):
            assert identical(episode.q, rollout(scenario, policy, seed).q)

    def test_frozen_and_says_its_parameters(self, file):
        policy = baselines.make("agent", FAST, path=file)
        others = {"trust": False, "offsets": None, "hash": policy.file.digits, "any_arm": False}
        assert policy.parameters == {"path": file, **others}
        assert set(policy.parameters) == set(policy.parameter_names())
        with pytest.raises(dataclasses.FrozenInstanceError):
            policy.path = "x"
        for other in (baselines.make("agent", FAST, **policy.parameters), copy.deepcopy(policy)):
            assert other.parameters == policy.parameters
        loaded = pickle.loads(pickle.dumps(policy))
        observation = next(observations(FAST, policy.preview, 2))
        assert identical(loaded.predict(observation), policy.predict(observation))


class TestBasePolicy:
    @pytest.mark.parametrize("base_policy", BASES[1:])
    def test_an_output_of_zero_is_the_base_policy(self, tmp_path, base_policy):
        noisy = ikgym.Plant(bias=0.01, noise=0.1)
        scenario = RANDOM.replace(steps=200, plant=noisy)
        policy = agent_for(tmp_path, scenario, base_policy, zero=True)
        name, parameters = parse_policy(base_policy)
        base = baselines.make(name, scenario, **parameters)
        ours, theirs = rollout(scenario, policy, 3), rollout(scenario, base, 3)
        # Bit for bit but for one word: a sum has not converged, whatever its parts have.
        assert identical(ours.status, np.maximum(theirs.status, Status.APPLIED))
        for field in dataclasses.fields(theirs):
            if field.name not in {"time_ns", "status"}:
                mine, other = getattr(ours, field.name), getattr(theirs, field.name)
                assert identical(mine, other), field.name
        observation = next(observations(scenario, policy.preview, 2))
        shown = {**observation, "nominal": observation["nominal"][:, : base.preview]}
        states = policy.predict(observation)[1], base.predict(shown)[1]
        assert identical(states[0][1:], states[1][1:])
        assert identical(policy.diagnostics(states[0]), base.diagnostics(states[1]))

    def test_an_output_adds_to_it(self, tmp_path):
        policy = agent_for(tmp_path, FAST, "dls")
        observation = next(observations(FAST, policy.preview, 1))
        base, _ = baselines.make("dls", FAST).predict(observation)
        assert (policy.predict(observation)[0] != base).all()

    def test_the_worse_status_counts(self, tmp_path):
        straight = ikgym.scenarios.get("varga7-fast").replace(start=np.zeros(7), steps=STEPS)
        policy = agent_for(tmp_path, straight, "moore_penrose", zero=True)
        observation, _ = gym.make("RedundantIK-v0", scenario=straight, preview=policy.preview).reset()
        assert policy.report(policy.predict(observation)[1]).status.tolist() == [Status.RANK_DEFICIENT]
        patient = agent_for(tmp_path, FAST, "mfac", zero=True)  # its base policy converges, but not the sum
        state = patient.predict(next(observations(FAST, patient.preview, 1)))[1]
        assert patient.report(state).status.tolist() == [Status.APPLIED]
        slow = FAST.replace(velocity_limit=1e-3)
        policy = agent_for(tmp_path, slow)
        observation = next(observations(slow, policy.preview, 1))
        action, state = policy.predict(observation)
        assert policy.report(state).status.tolist() == [Status.SATURATED]
        assert np.abs(action).max() == 1.0

    @pytest.mark.parametrize(
        ("base_policy", "message"),
        [
            ("oracle", "got the reference 'oracle'"),
            ("smoothed:policy=oracle", "got the reference 'oracle'"),
            ("dls:damping=-1", "damping: expected"),
        ],
    )
    def test_what_cannot_be_a_base_policy(self, tmp_path, base_policy, message):
        with pytest.raises(InvalidInputError, match=rf"Agent .*a\.safetensors: .*{message}"):
            agent_for(tmp_path, FAST, base_policy)

    @pytest.mark.parametrize(
        "base_policy",
        [
            "agent:x.safetensors",
            "agent_alone",
            "smoothed:policy=agent,options={'path': 'x.zip'}",
            "smoothed:policy=agent_residual",
            "smoothed:policy=smoothed,options={'policy': 'agent', 'options': {'path': 'x.zip'}}",
        ],
    )
    def test_a_file_names_no_other_file(self, tmp_path, base_policy):
        message = (
            r"Agent .*a\.safetensors cannot be used: base_policy: expected a policy that is no agent and is not made"
        )
        path = write_agent(tmp_path / "a.safetensors", FAST, base_policy)
        for reads in (lambda: load_agent(tmp_path / "a.safetensors"), lambda: baselines.make("agent", FAST, path=path)):
            with pytest.raises(ResultsError, match=message):
                reads()
        with pytest.raises(InvalidInputError, match="base_policy: expected a policy that is no agent"):
            make_base_policy(Processing(base_policy=base_policy), Problem.of(FAST))

    def test_unknown_names_are_the_fault_of_the_file(self, tmp_path):
        for base_policy, message in {
            "dlss": "no policy 'dlss'",
            "dls:dampng=1": "no parameter of dls 'dampng'",
        }.items():
            with pytest.raises(ResultsError, match=rf"Agent .*a\.safetensors cannot be used: .*{message}"):
                agent_for(tmp_path, FAST, base_policy)

    def test_smoothed_over_an_agent(self, tmp_path):
        path = write_agent(tmp_path / "a.safetensors", FAST, "dls")
        policy = baselines.make("smoothed", FAST, policy="agent", options={"path": path})
        assert policy.preview == OFFSETS
        assert rollout(FAST, policy, 0).q.shape == (STEPS, 7)


class TestPreview:
    def test_an_env_that_shows_all_steps_does_too(self, tmp_path):
        policy = agent_for(tmp_path, RANDOM, "rhc_gradient")
        assert policy.preview == OFFSETS
        for rows in (1, 3):
            pairs = zip(observations(RANDOM, OFFSETS, rows), observations(RANDOM, 25, rows), strict=True)
            for some, every in pairs:
                assert identical(policy.predict(some), policy.predict(every))
        assert identical(rollout(RANDOM, policy, 0).q, rollout(RANDOM, policy, 0, preview=20).q)

    @pytest.mark.parametrize("preview", [1, 3, 19, (1, 2, 3, 4, 5)])
    def test_too_few_steps(self, tmp_path, preview):
        policy = agent_for(tmp_path, FAST)
        shown = preview if isinstance(preview, int) else len(preview)
        with pytest.raises(
            InvalidInputError,
            match=rf"agent needs to be shown the steps \(1, 2, 5, 20\) ahead, the observation has {shown}: .*w=\(1, 2",
        ):
            policy.predict(next(observations(FAST, preview, 1)))

    def test_no_nominal(self, tmp_path):
        observation = row(next(observations(FAST, OFFSETS, 1)), 0)
        with pytest.raises(InvalidInputError, match=r"observation\['nominal'\]: expected shape \(20, 6\), got \(6,\)"):
            agent_for(tmp_path, FAST).predict({**observation, "nominal": np.zeros(6)})


class TestScenarios:
    def test_others_with_the_same_arm_will_do(self, file):
        for name in ("varga7-random", "varga7-fast"):
            assert rollout(ikgym.scenarios.get(name).replace(steps=STEPS), baselines.make("agent", name, path=file), 0)

    def test_others_will_not(self, file):
        for name, words in {"khan8-q1": "8 joints and 12", "zhang3-helix": "3 joints and 3"}.items():
            with pytest.raises(
                InvalidInputError, match=rf"Agent .* was trained for 7 joints and 6 .*; here there are {words}"
            ):
                baselines.make("agent", name, path=file)

    def test_another_arm_only_if_told_so(self, tmp_path, monkeypatch):
        """One with as many joints, too; a file that does not say its arm says its scenario."""
        here, describe = ikgym.scenarios.get("panda-random").replace(steps=STEPS), files.description
        whole = ikgym.scenarios.get("varga7-pose-random")
        said = r"was trained for the arm varga7, which moves differently from panda: expected that arm, or any_arm=True"
        file = write_agent(tmp_path / "new.safetensors", whole, None)
        monkeypatch.setattr(files, "description", lambda *given: without(describe(*given), "arm"))
        for of_varga7 in (file, write_agent(tmp_path / "old.safetensors", whole, None)):
            with pytest.raises(InvalidInputError, match=said):
                baselines.make("agent", here, path=of_varga7)
            assert rollout(here, baselines.make("agent", here, path=of_varga7, any_arm=True), 0)
        unknown = write_agent(tmp_path / "unknown.safetensors", whole.replace(name="mine"), None)
        assert rollout(here, baselines.make("agent", here, path=unknown), 0)

    def test_shipped_agents_play_on_their_arm(self):
        with pytest.raises(InvalidInputError, match="was trained for the arm varga7"):
            baselines.make("agent_residual", "panda-random")

    def test_a_network_of_another_size(self, tmp_path):
        save_agent(tmp_path / "a.safetensors", network((5, 7)), Processing(offsets=OFFSETS), FAST)
        with pytest.raises(InvalidInputError, match=r"from \d+ features to 7 outputs, got 5 and 7"):
            baselines.make("agent", FAST, path=str(tmp_path / "a.safetensors"))


class TestNames:
    def test_an_agent_is_nothing_by_its_name_alone(self, file):
        assert "agent" not in baselines.names()
        assert registry.get("agent") is Agent
        assert isinstance(baselines.make("agent", "varga7-fast", path=file), Agent)
        for parameters in ({}, {"path": ""}, {"path": 5}, {"path": None}):
            with pytest.raises(ResultsError, match=r"agent: expected the path of its file, as in agent:PATH, got"):
                baselines.make("agent", "varga7-fast", **parameters)
        with pytest.raises(ResultsError, match="expected the path"):
            make_plan(FAST, ["dls", "agent"])
        with pytest.raises(UnknownNameError, match=r"no policy 'agnet'\. Did you mean 'agent'\?"):
            baselines.make("agnet", "varga7-fast")

    @pytest.mark.parametrize(
        ("text", "parameters"),
        [
            ("agent:runs/a.safetensors", {"path": "runs/a.safetensors"}),
            ("agent: runs/a b,c.zip ", {"path": "runs/a b,c.zip"}),
            ("agent:runs/lr=1e-3/a.zip", {"path": "runs/lr=1e-3/a.zip"}),
            (r"agent:C:\runs\a.zip", {"path": r"C:\runs\a.zip"}),
            ("agent:path=a.zip", {"path": "a.zip"}),
            ("agent:path=a.zip,trust=True,offsets=(1, 2)", {"path": "a.zip", "trust": True, "offsets": (1, 2)}),
            ("agent:hash=abc,path=a.zip", {"hash": "abc", "path": "a.zip"}),
        ],
    )
    def test_texts(self, text, parameters):
        assert parse_policy(text) == ("agent", parameters)

    def test_texts_of_others_are_as_before(self):
        with pytest.raises(InvalidInputError, match="expected name=value"):
            parse_policy("dls:some/path")
        assert parse_policy("dls:damping=" + "-" * 100_000 + "1")[1]["damping"].startswith("--")

    def test_paths(self, file, monkeypatch, tmp_path):
        monkeypatch.setenv("HOME", str(tmp_path))
        monkeypatch.chdir(tmp_path)
        for path in (tmp_path / "mine.safetensors", "mine.safetensors", "~/mine.safetensors"):
            policy = baselines.make("agent", FAST, path=path)
            assert policy.parameters["path"] == str(path)

    def test_a_hash_to_insist_on(self, file):
        digits = baselines.make("agent", FAST, path=file).hash
        assert baselines.make("agent", FAST, path=file, hash=digits).hash == digits
        with pytest.raises(InvalidInputError, match=f"hash: expected {digits}, which .* has, got 'abc'"):
            baselines.make("agent", FAST, path=file, hash="abc")

    def test_parameters_that_are_not_for_it(self, file):
        with pytest.raises(InvalidInputError, match=r"offsets: .* says itself what it sees"):
            baselines.make("agent", FAST, path=file, offsets=(1, 2))
        with pytest.raises(InvalidInputError, match="trust: expected True or False"):
            baselines.make("agent", FAST, path=file, trust=1)


@pytest.fixture
def ship(tmp_path, monkeypatch):
    """Adds agents to those of the package."""
    monkeypatch.setattr(registry, "_places", dict(registry._places))
    monkeypatch.setattr(registry, "_classes", dict(registry._classes))

    def add(*names, base_policy="dls:damping=1e-2"):
        classes = {}
        for number, name in enumerate(names):
            path = tmp_path / f"{name}.safetensors"
            write_agent(path, FAST, base_policy, seed=number, training={"method": "ppo"})
            digits = load_agent(path).digits
            body = {"__annotations__": {"hash": "str"}, "hash": digits, "name": name, "folder": tmp_path}
            kind = type(name, (shipped.ShippedAgent,), body)
            classes[name] = dataclasses.dataclass(frozen=True, eq=False)(kind)
            baselines.register(name, classes[name])
        return classes

    return add


class TestShipped:
    def test_each_file_is_a_policy(self, ship):
        classes = ship("agent_one", "agent_two")
        assert {"agent_one", "agent_two"} < set(baselines.names())
        for name, kind in classes.items():
            policy = baselines.make(name, FAST)
            assert type(policy) is kind
            assert policy.name == name
            assert policy.parameters == {"hash": policy.file.digits}
            again = baselines.make(name, FAST, **policy.parameters)
            observation = next(observations(FAST, policy.preview, 2))
            assert identical(again.predict(observation), policy.predict(observation))

    def test_it_is_part_of_all_where_it_suits(self, ship):
        ship("agent_one")
        plan = make_plan(["varga7-random", "khan8-q1"], "all")
        assert [job.scenario.name for job in plan.jobs if job.policy == "agent_one"] == ["varga7-random"]
        (reason,) = [s.reason for s in plan.skipped if s.policy == "agent_one"]
        assert reason.startswith("Agent agent_one was trained for 7 joints")

    def test_a_file_that_was_replaced_behind_its_back(self, ship, tmp_path):
        ship("agent_one")
        write_agent(tmp_path / "agent_one.safetensors", FAST, seed=5)
        with pytest.raises(ResultsError, match="Agent agent_one has the hash"):
            baselines.make("agent_one", FAST)

    def test_a_damaged_one_is_found_when_it_is_made(self, ship, tmp_path):
        ship("agent_one", "damaged")
        (tmp_path / "damaged.safetensors").write_bytes(b"x")
        assert baselines.make("agent_one", FAST)
        with pytest.raises(ResultsError, match="Agent damaged is cut off"):
            baselines.make("damaged", FAST)

    def test_those_of_the_package(self):
        files = sorted(shipped.FOLDER.glob("*.safetensors"))
        kinds = {name: registry.get(name) for name in baselines.names()}
        ours = {name: kind for name, kind in kinds.items() if issubclass(kind, shipped.ShippedAgent)}
        assert sorted([*ours, SHIPPED]) == [file.stem for file in files]  # that with memory is played as `recurrent`
        for name, kind in ours.items():
            assert pickle.loads(pickle.dumps(kind)) is kind
            assert kind.name == name
            about = baselines.make(name, "varga7-random").file.about
            base_policy = about["processing"].get("base_policy")
            role = "that stands alone" if base_policy is None else f"of `{base_policy}`"
            assert f"{role}, trained on `{about['scenario']['name']}` by {about['training']['method']}." in kind.__doc__


def test_the_problem_is_all_that_an_agent_is_told(tmp_path):
    exact = ikgym.scenarios.get("khan8-q1").replace(steps=STEPS)
    other = exact.replace(arm=exact.arm.replace(name="other", offsets=-2.0 * exact.arm.offsets), model=exact.model)
    policies = [agent_for(tmp_path, scenario, "dls") for scenario in (exact, other)]
    assert all(isinstance(p.problem, Problem) and p.inner.problem is p.problem for p in policies)
    for observation in observations(exact, OFFSETS, 2):
        assert identical(*(p.predict(observation)[0] for p in policies))
