"""Recovery and right paths on skew coordinates."""

import json

from docs import skew


def test_displaced_arms_recover_on_whole_poses():
    assert skew._recovered(skew.WHOLE, skew.seeds(range(2)), 0, seed=0) == 2


def test_a_killed_measurement_continues_where_it_was(tmp_path, monkeypatch):
    monkeypatch.setattr(skew, "WORK", tmp_path)
    monkeypatch.setattr(skew, "BEYOND", range(66, 66))
    first, _ = skew.seeds(range(64, 66))
    kept = tmp_path / "right_paths.jsonl"
    kept.write_text(json.dumps({"seed": first, "angle": 0.5, "times_cheapest": None}) + "\n")
    monkeypatch.setattr(skew, "_right_path", lambda seed: {"seed": seed, "angle": 0.01, "times_cheapest": 1.0})
    assert [line["seed"] for line in skew.right_paths()] == [first]
    assert not kept.exists()
