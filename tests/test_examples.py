"""Every example runs."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

EXAMPLES = sorted(Path(__file__).parents[1].glob("examples/[0-9]*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example(example, capsys, tmp_path):
    small = {"04_video": (tmp_path / "video.mp4", 40), "09_behaviour_cloning": (2, 3, 1)}
    arguments = small.get(example.stem, ())
    runpy.run_path(str(example))["main"](*arguments)
    printed = capsys.readouterr().out
    assert printed.strip()
    if example.stem == "04_video":
        assert arguments[0].stat().st_size > 1000
    if example.stem == "09_behaviour_cloning":
        first, *_, last = map(float, re.findall(r"loss ([\d.]+)", printed))
        assert last < 0.8 * first


@pytest.mark.slow
def test_a_clone_of_dls_follows_the_path(capsys):
    """On an episode that is not in its data set."""
    (example,) = (one for one in EXAMPLES if one.stem == "09_behaviour_cloning")
    runpy.run_path(str(example))["main"](16, 5, 1)
    (error,) = re.findall(
        r"^Clone, seed 1000000: cost .*, error up to ([\d.]+) mm$", capsys.readouterr().out, re.MULTILINE
    )
    assert 0.01 < float(error) < 5.0


def test_there_are_examples():
    assert len(EXAMPLES) >= 4
