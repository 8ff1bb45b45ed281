"""What policies say of their operations is what they do, call by call."""

from __future__ import annotations

import pytest

import baselines
from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.files import save_agent
from baselines.agents.relative.processing import Relative
from baselines.evaluation.operation_audit import audit
from baselines.policy import Problem
from baselines.registry import get
from baselines.solvers.resolved_rate.dls import DampedLeastSquares
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from tests.baselines.random_agents import network

#: Few iterations, since nothing is compiled here.
FEW = {
    "mfac": [{"iterations": 3, "rule": "condition"}, {"rule": "constant", "damping": 0.0, "one_step": True}],
    "mfapc": [{"iterations": 3}, {"horizon": 3, "iterations": 2, "jacobians": "constant"}, {"one_step": True}],
    "rhc_gradient": [{"iterations": 3}, {"iterations": 3, "gradient": "analytic"}],
    "rhc_lagrange": [{"iterations": 3}, {"iterations": 3, "gradient": "analytic"}],
    "smoothed": [{"policy": "dls"}, {"policy": "mfac", "options": {"iterations": 3}, "feedback": "measured"}],
    "full_orientation": [{"policy": "dls"}, {"policy": "mfac", "options": {"iterations": 3}}],
    "null_space": [{}, {"damping": 0.0}, {"objective": "manipulability"}],
    "broyden": [{"learns": "correction"}, {"learns": "jacobian"}],
}

#: References that need a seed or long to be made, and do nothing that is counted; and what is not compiled here.
KNOWN_BEFORE = {"oracle", *(name for name in baselines.names() if get(name).rival)}


#: They measure at most in each step.
CORRECTED = ("offset_free", "kalman_jacobian", "calibrated")


def stated(name):
    return baselines.make(name, "varga7-fast").stated


def counted():
    names = [name for name in baselines.names() if name not in KNOWN_BEFORE and not stated(name)]
    return [(name, parameters) for name in names for parameters in FEW.get(name, [{}])]


def test_every_policy_that_counts_counts_right():
    policies = counted()
    for (name, parameters), audited in zip(policies, audit("varga7-fast", policies, steps=2), strict=True):
        assert len(audited.counted) == 2, name
        assert audited.counted == audited.stated, (name, parameters)
        assert get(name).reference or any(map(sum, audited.counted)), name


@pytest.mark.parametrize("processing", [
    Bilinear((1, 5)), Bilinear((1, 5), 1e-3), Bilinear((1, 5, 9), 1e-3, predicted_rates=True), Relative((1, 5), 5.0),
    Relative((1, 5), 5.0, bilinear=True, damping=1e-3),
])  # fmt: skip
def test_agents_count_what_their_processing_takes(tmp_path, processing):
    file, scenario = tmp_path / "agent.safetensors", scenarios.get("varga7-pose-random")
    problem = Problem.of(scenario)
    save_agent(
        file, network((processing.size(problem), processing.outputs(problem)), squash="linear"), processing, scenario
    )
    (audited,) = audit("varga7-pose-random", [("agent", {"path": str(file)})], steps=2)
    assert audited.counted == audited.stated


def test_those_that_estimate_say_so():
    assert {name for name in baselines.names() if name not in KNOWN_BEFORE and stated(name)} == {
        "rhc",
        "rhc_foresight",
        "agent_residual",  # around `rhc`
        *CORRECTED,
    }
    (audited,) = audit("varga7-fast", [("rhc", {"horizon": 3, "iterations": 1})], steps=3)
    assert audited.counted[1:] == audited.stated[1:]  # steps that are neither damped nor shortened
    assert audited.counted[0] != audited.stated[0]  # the initial guess
    assert not audited.agrees


def test_corrected_models_are_right_about_steps_that_measure():
    for audited in audit("varga7-fast", [(name, {"policy": "dls"}) for name in CORRECTED], steps=2):
        assert audited.agrees


class Misstated(DampedLeastSquares):
    """Says that it inverts nothing."""

    def count(self, iterations):
        return 0, 1, 0, 1


def test_a_wrong_statement_is_found():
    (audited,) = audit("varga7-fast", [(f"{__name__}:Misstated", {})], steps=1)
    assert audited.counted == [(0, 1, 1, 1)]
    assert audited.stated == [(0, 1, 0, 1)]
    assert audited.total("factorisations") == 1
    assert not audited.agrees


def test_what_the_process_refuses():
    with pytest.raises(InvalidInputError, match=r"The audit of varga7-fast failed: .*no policy 'dsl'"):
        audit("varga7-fast", [("dsl", {})])
