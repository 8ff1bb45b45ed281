"""Like claims of Khan's have one threshold: what is degraded in one row has not remained in another."""

from __future__ import annotations

import pytest

from baselines.papers.khan import general_path_claims, level_path_claims
from baselines.papers.runs import Runs

KEYS = ("rms_position_error_m", "rms_orientation_error_rad", "largest_position_error_m")


def verdicts(monkeypatch, growth, largest):
    """The verdicts of the rows that compare runs with weights, if both errors have grown by a share."""
    before = dict(zip(KEYS, (0.04, 0.1, largest), strict=True))
    after = {key: (1.0 + growth) * value for key, value in before.items()}
    for claims in (level_path_claims, general_path_claims):
        monkeypatch.setattr(claims, "compare", lambda *_: (before, after))
    rows = {claim.name: claim for claim in (*level_path_claims.CLAIMS, *general_path_claims.CLAIMS)}
    names = ("F weights orientation down", "F couples", "W degrades q7 and q8", "W keeps precision")
    return [rows[name].test(Runs(steps=60)).verdict for name in names]


@pytest.mark.parametrize("growth", [0.05, 0.27, 0.3])
def test_what_is_degraded_has_not_remained(monkeypatch, growth):
    """An error of 9 m is visible on this path, and one of 1 nm is not."""
    degraded = growth > 0.1
    rows = ["reproduced" if degraded else "contradicted"] * 3
    assert verdicts(monkeypatch, growth, 9.0) == [*rows, "contradicted" if degraded else "depends"]
    assert verdicts(monkeypatch, growth, 1e-9) == [*rows, "depends" if degraded else "reproduced"]
