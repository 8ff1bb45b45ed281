"""What the tests of the pages share."""

import pytest

from baselines.oracle import best_known
from baselines.oracle.best_known import Record, episode_hash
from ikgym import scenarios


@pytest.fixture
def records(tmp_path, monkeypatch):
    """Lets best known costs be what a test says, by seed."""
    path = tmp_path / "best.json"
    monkeypatch.setattr(best_known, "DATA", path)

    def known(name, costs):
        scenario = scenarios.get(name)
        best_known.record(
            [Record(name, s, cost, "a test", 0.0, {}, episode_hash(scenario, s)) for s, cost in costs.items()], path
        )

    return known
