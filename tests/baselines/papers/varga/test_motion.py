"""What the tests of Varga's claims on the motion measure."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines.papers.runs import Runs
from baselines.papers.varga.claims import CLAIMS
from baselines.papers.varga.episodes import CONSIDERABLE, MORE, fluctuation, largest_jump, variation
from baselines.papers.varga.figures import busiest
from baselines.papers.varga.motion import _nominal_angles, skew_determines


def ramp(steps=400):
    """Seven velocities that grow evenly, from a jump at the start."""
    qdot = np.outer(1.0 + 1e-3 * np.arange(steps), np.ones(7))
    qdot[:3] = [[0.0] * 7, [9.0] * 7, [0.0] * 7]
    return qdot


def test_fluctuation_leaves_out_the_start():
    qdot = ramp()
    assert fluctuation(qdot) < 1e-12
    assert largest_jump(qdot) == pytest.approx(1e-3 / 9.0)
    qdot[200, 3] += 2.0
    assert largest_jump(qdot) == pytest.approx(2.001 / 9.0)
    assert fluctuation(qdot) == pytest.approx(np.sqrt((4 + 16 + 4) / (378 * 7)), rel=1e-6)


def test_variation_is_the_sum_of_all_changes():
    qdot = np.zeros((5, 7))
    qdot[2, 0], qdot[3:, 6] = 3.0, -1.0
    assert variation(qdot) == 7.0


def test_a_close_up_is_of_the_fluctuations_and_not_of_the_start():
    qdot = ramp()
    qdot[300:310:2] += 0.1
    part = busiest(qdot)
    assert part.stop - part.start == 150
    assert part.start <= 299
    assert part.stop >= 309
    assert part.start >= 20


def rotation(axis, angle):
    x, y, z = axis
    generator = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * generator + (1 - np.cos(angle)) * generator @ generator


@pytest.mark.parametrize("angle", [1.6, 2.5, 3.1])
def test_beyond_90_degrees_another_rotation_has_the_same_skew_part(angle):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    one, other = rotation(axis, angle), rotation(axis, np.pi - angle)
    np.testing.assert_allclose(one - one.T, other - other.T, atol=1e-15)
    apart = np.arccos(0.5 * (np.trace(one.T @ other) - 1.0))
    assert apart == pytest.approx(abs(np.pi - 2.0 * angle))


def test_the_fast_path_is_beyond_90_degrees_most_of_the_time():
    finding = skew_determines(Runs())
    assert finding.verdict == "contradicted"
    assert finding.numbers["shares"]["varga7-fast"] == pytest.approx(0.814, abs=1e-3)
    assert finding.numbers["shares"]["varga7-slow"] == 0.0
    scenario = ikgym.scenarios.get("varga7-slow")
    wanted = [
        np.linalg.norm(ikgym.rotations.rotation_vector(r))
        for r in scenario.arm.forward(scenario.nominal_joint_path())[0]
    ]
    np.testing.assert_allclose(_nominal_angles(Runs(), "varga7-slow"), wanted, atol=1e-9)


def test_like_claims_have_the_same_threshold_and_say_it():
    how = {claim.name: claim.how for claim in CLAIMS}
    for name in ("multipliers cost more", "smoothing calms", "smoothing errs"):
        assert f"{CONSIDERABLE:g} " in how[name]
    assert MORE == 1.1
    for name in ("slow is finer", "slow fluctuates", "velocities bounded", "time proportional"):
        assert "a tenth" in how[name]
