"""The tables of solvers of other projects: their sums, and the scenes that settings are tuned on."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from docs import rivals, tuned
from docs.keeping import lines


def test_sums_are_those_of_the_paths():
    kept = {one["policy"]: one for one in lines("rivals")}
    for one in rivals.sums(lines("rivals_paths")):
        before = kept.pop(one["policy"])
        for column in ("paths", "smallest_position_error", "without_a_limit", "without_solution"):
            assert one[column] == int(before[column])
    assert not kept


def test_a_tuned_solver_has_two_rows_among_bodies():
    """With the settings of the table, beside its defaults."""
    rows = {(one["scenario"], one["policy"]) for one in lines("bodies")}
    for one in lines("tuned"):
        for scenario in tuned.SCENES:
            assert (scenario, one["policy"]) in rows
            assert not one["settings"] or (scenario, f"{one['policy']}:{one['settings']}") in rows
        assert int(one["trials"]) == tuned.TRIALS


@pytest.mark.parametrize("name", tuned.SCENES)
def test_a_validation_scene_is_another_one(name):
    scene, scenario = tuned.scene(name), ikgym.scenarios.get(name)
    assert scene.steps == tuned.STEPS < scenario.steps
    faster = np.abs(scene.nominal(0)[1000] - scenario.nominal(0)[1000]).max() > 1e-3
    assert faster or scene.obstacles  # bends of the shelf's path allow no more speed
    for moved, usual in zip(scene.obstacles, scenario.obstacles, strict=True):
        np.testing.assert_allclose(moved.position - usual.position, tuned.MOVED)
