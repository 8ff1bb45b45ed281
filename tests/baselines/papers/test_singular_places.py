"""Yanks at singular points: what inversion does near the shoulder axis, and what the fixed point does there."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.papers.faitli import method_claims
from baselines.papers.faitli.episodes import YANK, past_shoulder, solved, speeds, yank
from baselines.papers.khan import background_claims
from baselines.papers.runs import Runs


@pytest.mark.parametrize("distance", [0.1, 0.001])
def test_a_line_passes_the_axis_at_its_distance(distance):
    positions = past_shoulder(Runs(), distance).nominal()
    np.testing.assert_allclose(np.linalg.norm(positions[:, :2], axis=1).min(), distance, rtol=0.2)
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=1) / 1e-3
    assert 0.85 < speed.max() < 0.95


def test_inversion_yanks_one_millimetre_from_the_axis_and_the_fixed_point_does_not():
    runs = Runs()
    line = past_shoulder(runs, 0.001)
    inversion, method = runs.play(line, "moore_penrose"), solved(runs, line)
    assert speeds(inversion).max() > 500.0
    assert yank(inversion) > 10.0 * YANK
    assert speeds(method).max() < 2.0
    assert yank(method) < 2.0
    assert method.position_error.max() < 2e-3


@pytest.mark.slow
def test_both_rows_on_yanks_agree():
    """Faitli's and Khan's claim are of the same runs, and the evidence names the same places."""
    runs = Runs()
    faitli, khan = (
        next(c for c in claims.CLAIMS if c.name == name).test(runs)
        for claims, name in ((method_claims, "no yanks"), (background_claims, "stagnation"))
    )
    assert faitli.verdict == khan.verdict == "reproduced"
    yanked = {n for n, v in faitli.numbers["places"].items() if v["pseudoinverse_multiple"] > YANK}
    assert set(khan.numbers["places"]) == yanked
    assert len(yanked) == 3
