"""The interpreted descent, whose time the ledger tells, is that of ``rhc_gradient``."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines.papers.varga.interpreted import descend


@pytest.mark.parametrize("name", ["varga7-fast", "varga7-literal-slow"])
def test_the_same_plan(name):
    scenario = ikgym.scenarios.get(name)
    q, nominal = scenario.nominal_joint_path()[200], scenario.nominal()[201:203]
    policy = baselines.make("rhc_gradient", scenario, tolerance=0.0, iterations=60)
    observation, _ = ikgym.RedundantIKEnv(scenario, preview=2).reset(options={"q": q})
    _, state = policy.predict({**observation, "nominal": nominal})
    plan = state[2][0]
    assert 0.1 < abs(plan).max() < 20.0
    np.testing.assert_allclose(descend(scenario, q, nominal, 60), plan, rtol=1e-6, atol=1e-9)
