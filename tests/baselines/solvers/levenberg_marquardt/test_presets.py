"""The examples of Zhang 2020 as presets: the printed numbers, on their scenarios."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout

#: (44) of example 1, (59) of example 2.
RULE_44 = {"rule": "threshold", "damping": 2.0, "growth": 1.1, "decay": 1.02, "threshold": 10.0, "carry": True}
PRINTED = {
    "mfac_helix": ("zhang3-helix", "mfac", {**RULE_44, "one_step": True}),
    "mfapc_helix": ("zhang3-helix", "mfapc", {**RULE_44, "one_step": True, "horizon": 5, "jacobians": "constant"}),
    "mfapc_line": ("zhang6-lspb", "mfapc", {"rule": "constant", "damping": 0.0, "horizon": 2, "iterations": 10}),
}
presets = pytest.mark.parametrize("name", PRINTED)


@presets
def test_a_preset_is_its_solver_with_the_printed_numbers(name):
    on, solver, numbers = PRINTED[name]
    scenario = ikgym.scenarios.get(on).replace(steps=200)
    preset, plain = baselines.make(name, scenario), baselines.make(solver, scenario, **numbers)
    assert preset.parameters == plain.parameters
    assert preset.preview == plain.preview
    one, other = (rollout(scenario, policy, 0) for policy in (preset, plain))
    np.testing.assert_array_equal(one.q, other.q)


@presets
def test_a_preset_tracks_its_example(name):
    on, *_ = PRINTED[name]
    (row,) = baselines.evaluate.evaluate([ikgym.scenarios.get(on)], [name])
    assert row.policy == name
    # The transient of example 1 is 18 m long at first; without it the bounds are those of the ledger.
    assert row.position_error_rms < {"mfac_helix": 1.5, "mfapc_helix": 1.5, "mfapc_line": 1e-9}[name]
    assert row.status in ("converged", "applied", "iteration_limit")


@presets
def test_a_number_of_another_rule_is_refused(name):
    with pytest.raises(ikgym.exceptions.InvalidInputError, match=r"expected nothing, as the damping rule 'table' has"):
        baselines.make(name, PRINTED[name][0], rule="table")
