"""Both examples of Zhang 2020."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.status import Status
from tests.baselines.solvers.levenberg_marquardt.test_block_tridiagonal import printed


def test_example_1_follows_the_printed_controller():
    """(27), (28) and (44) with constant J; the first measurement is 0, and λ falls from the eighth sample on."""
    scenario = ikgym.scenarios.get("zhang3-helix").replace(steps=120)
    policy = baselines.make("mfapc_helix", scenario)
    nominal = scenario.nominal(preview=5)
    q, pose, damping, falls = np.zeros(3), np.zeros(3), 2.0, []
    episode = rollout(scenario, policy, seed=0)
    for k in range(120):
        residuals = nominal[k + 1 : k + 6] - pose
        q = q + printed(np.stack([scenario.model.jacobian(q)[:3]] * 5), residuals, damping)[0]
        pose = scenario.model.forward(q)[1]
        far = np.linalg.norm(residuals) > 10
        damping = damping * 1.1 if far else damping / 1.02
        falls.append(not far)
        # The actions are float32; the loop forgets what they leave.
        np.testing.assert_allclose(episode.q[k], q, atol=1e-4)
    assert falls.index(True) == 7
    assert all(falls[7:])
    assert episode.position_error[-1] < 0.05
    assert set(episode.status) == {Status.APPLIED}


#: (44) of example 1, (59) of example 2.
RULE_44 = {"rule": "threshold", "damping": 2.0, "growth": 1.1, "decay": 1.02, "threshold": 10.0, "carry": True}
PRESETS = {
    "mfac_helix": ("zhang3-helix", "mfac", {**RULE_44, "one_step": True}),
    "mfapc_helix": ("zhang3-helix", "mfapc", {**RULE_44, "one_step": True, "horizon": 5, "jacobians": "constant"}),
    "mfapc_line": ("zhang6-lspb", "mfapc", {"rule": "constant", "damping": 0.0, "horizon": 2, "iterations": 10}),
}


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_its_solver_with_the_printed_numbers(name):
    on, solver, numbers = PRESETS[name]
    preset, plain = baselines.make(name, on), baselines.make(solver, on, **numbers)
    assert preset.parameters == plain.parameters
    assert preset.preview == plain.preview
