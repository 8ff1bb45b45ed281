"""Agents with memory: their network, their filter, and the arms that they refuse."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.agents.files import agent_of, save_agent
from baselines.agents.policy import FOLDER
from baselines.agents.recurrent.network import GatedNetwork, shapes
from baselines.agents.recurrent.policy import RecurrentPolicy
from baselines.episodes import rollout
from baselines.files import ResultsError
from baselines.training.config import Observe
from ikgym.exceptions import InvalidInputError
from tests.baselines.agents.recurrent.recurrent_agents import PROCESSING, SIZES, constant, drawn, made

SHORT = ikgym.scenarios.get("panda-camera-slow").replace(steps=120)
SEEDS = ikgym.scenarios.seeds("validation", 3)


def test_with_constant_outputs_it_is_the_calibration_with_those_settings():
    """Twice the noise of the position at an output of 0, and half that of the orientation."""
    scale = np.array([2.0, 0.5, 0.05, 0.05])
    options = {"policy": "dls", "options": {"damping": 1e-2}, "start": PROCESSING.start, "jump": 0.0}
    noise = {"pose_noise": 6e-4, "pose_rotation_noise": 2.5e-4}
    other = baselines.make("calibrated", SHORT, **options, **noise)
    ours, theirs = (rollout(SHORT, policy, SEEDS[0]) for policy in (made(constant(scale), SHORT), other))
    np.testing.assert_allclose(ours.pose, theirs.pose, atol=1e-8)
    plain = rollout(SHORT, baselines.make("dls", SHORT, damping=1e-2), SEEDS[0])
    assert np.abs(ours.pose - plain.pose).max() > 1e-4  # it does correct


def test_another_arm_is_refused_unless_asked_for():
    with pytest.raises(InvalidInputError, match=r"trained for the arm panda, which moves differently.*any_arm=True"):
        made(scenario=ikgym.scenarios.get("varga7-pose-random"))
    other = SHORT.replace(model=SHORT.model.replace(tool=SHORT.model.tool + 1e-3))
    with pytest.raises(InvalidInputError, match="moves differently"):
        made(scenario=other)
    assert made(scenario=other, any_arm=True).any_arm
    with pytest.raises(InvalidInputError, match="was trained for 7 joints and 12 task coordinates"):
        made(scenario=SHORT.replace(task=ikgym.tasks.get("skew")), any_arm=True)
    with pytest.raises(InvalidInputError, match="any_arm: expected true or false"):
        made(scenario=SHORT, any_arm="yes")


def test_a_file_gives_the_same_agent_again(tmp_path):
    file, scenario = tmp_path / "agent.safetensors", ikgym.scenarios.get("panda-field")
    digits = save_agent(file, agent_of(drawn(), PROCESSING, scenario, {"seed": 1}))
    policy = baselines.make("recurrent", SHORT, path=str(file))
    assert policy.parameters["hash"] == digits[:12]
    with pytest.raises(InvalidInputError, match=f"hash: expected {digits[:12]}"):
        baselines.make("recurrent", SHORT, path=str(file), hash="0" * 12)
    assert policy.processing == PROCESSING
    np.testing.assert_array_equal(rollout(SHORT, policy, SEEDS[0]).q, rollout(SHORT, made(scenario=SHORT), SEEDS[0]).q)


def test_agents_of_other_kinds_are_refused():
    with pytest.raises(ResultsError, match="expected an agent of the kind recurrent, got 'bilinear'"):
        RecurrentPolicy.for_scenario(SHORT, path=str(FOLDER / "agent_alone.safetensors"))
    with pytest.raises(InvalidInputError, match="base_policy: expected a policy that is no agent"):
        made(processing=PROCESSING.replace(base_policy="agent:other.safetensors"))
    with pytest.raises(InvalidInputError, match="expected a network of the sizes"):
        made(drawn(sizes=(12, 4, 4)))


def test_the_agent_of_the_package_has_the_default_processing():
    policy = baselines.make("recurrent", SHORT)
    assert policy.processing == Observe().processing
    assert rollout(SHORT, policy, SEEDS[0]).position_error.max() < 2e-3


def test_networks_are_checked():
    whole = dict(drawn().tensors)
    with pytest.raises(InvalidInputError, match="tensors: expected float32 of the shapes"):
        GatedNetwork(SIZES, {name: tensor for name, tensor in whole.items() if name != "head.bias"})
    with pytest.raises(InvalidInputError, match="NaN or infinity"):
        GatedNetwork(SIZES, {**whole, "head.bias": np.full(4, np.nan, np.float32)})
    with pytest.raises(InvalidInputError, match="at least one layer"):
        shapes((13, 4))
