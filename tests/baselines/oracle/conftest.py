"""Records of best known costs in a file of the test."""

import pytest

from baselines.oracle import best_known


@pytest.fixture
def file(tmp_path, monkeypatch):
    path = tmp_path / "data" / "best.json"
    monkeypatch.setattr(best_known, "DATA", path)
    monkeypatch.setattr(best_known.record, "__defaults__", (path,))
    return path
