"""Example 1 of Zhang 2020."""

import numpy as np

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.papers.zhang.episodes import PREDICTIVE
from baselines.status import Status
from tests.baselines.solvers.levenberg_marquardt.test_block_tridiagonal import printed


def test_example_1_follows_the_printed_controller():
    """(27), (28) and (44) with constant J; the first measurement is 0, and λ falls from the eighth sample on."""
    scenario = ikgym.scenarios.get("zhang3-helix").replace(steps=120)
    policy = baselines.make("mfapc", scenario, **PREDICTIVE)
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
