"""Every example runs."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(ROOT.glob("[0-9]*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example(example, capsys, tmp_path):
    video = tmp_path / "video.mp4"
    small = {"04_video": (video, 40), "06_ppo": (1,), "08_behaviour_cloning": (2, 1, 1)}
    runpy.run_path(str(example))["main"](*small.get(example.stem, ()))
    assert capsys.readouterr().out.strip()
    assert video.exists() == (example.stem == "04_video")


@pytest.mark.slow
def test_the_ppo_of_the_example_learns(capsys):
    """Rewards are minus the decimal logarithm of 1 + cost: 0.2 more is a cost a third less."""
    rewards = runpy.run_path(str(ROOT / "06_ppo.py"))["main"](20)
    capsys.readouterr()
    assert np.mean(rewards[-3:]) > rewards[0] + 0.2


def test_there_are_examples():
    assert len(EXAMPLES) >= 4
