"""Configurations and presets of apg."""

import json
import os

import numpy as np
import pytest

from baselines.training.options import APG, preset_names
from ikgym.exceptions import IkgymError, InvalidInputError
from tests.baselines.training.small import tiny

#: Refused options, and a part of the message.
REFUSED = [
    ({"windo": 3}, "no option 'windo' of apg. Did you mean 'window'"),
    ({"activation": "sili"}, "Did you mean 'silu'"),
    ({"hidden": []}, "hidden: expected 1 to 10 whole numbers"),
    ({"hidden": [8, 0]}, "hidden: expected a whole number from 1 to 2048, got 0"),
    ({"offsets": [2, 5]}, "offsets: expected steps ahead that rise from 1"),
    ({"learning_rate": -1}, "learning_rate: expected a finite number above 0"),
    ({"window": 64}, "window: expected 1 to 100 whole numbers, got 64"),
    ({"window": [88]}, "window: expected .* that divide segment_steps, 1920, got 88"),
    ({"averaging": 1.5}, "averaging"),
]


@pytest.mark.parametrize(("values", "message"), REFUSED)
def test_refused(values, message):
    with pytest.raises(IkgymError, match=message):
        APG.from_json(values)


def test_configurations_are_json():
    config = tiny(n_envs=np.int64(6))
    assert APG.from_json(json.loads(json.dumps(config.to_json()))) == config
    assert APG.preset("smoke").make_scenario()
    assert APG.preset(None) == APG()


def test_values_of_segments():
    config = APG(segments=3, learning_rate=1e-2, learning_rate_end=1e-4)
    assert [config.schedule(n).learning_rate for n in range(3)] == pytest.approx([1e-2, 1e-3, 1e-4], rel=1e-12)
    assert (APG(steps=50).make_scenario().steps, APG(steps=5000).make_scenario().steps) == (50, 1000)
    config = tiny(segments=8, window=(16, 48), reset_distance=0.3, reset_distance_end=0.5)
    assert [config.schedule(number).window for number in range(8)] == [16] * 4 + [48] * 4
    assert [config.schedule(number).reset_distance for number in range(8)] == [0.3] * 4 + [0.5] * 4


def test_presets(tmp_path):
    assert preset_names() == ("quick", "standard", "long", "smoke")
    (tmp_path / "mine.toml").write_text("windo = 2\n")
    with pytest.raises(IkgymError, match="no option 'windo' of apg"):
        APG.preset(str(tmp_path / "mine.toml"))
    (tmp_path / "mine.toml").write_text("window = \n")
    os.mkfifo(tmp_path / "pipe.toml")
    for name, message in (
        ("mine.toml", "mine.toml: invalid TOML"),
        ("none.toml", "Cannot read .*none.toml: No such file"),
        ("pipe.toml", "Cannot read .*pipe.toml: expected a regular file"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            APG.preset(str(tmp_path / name))
