"""Every example runs."""

import importlib.util
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "examples"
#: Arguments that make each example short.
SMALL = {"own_policy": (1,), "real_arm": (0.5, 0.02, False), "sac": ("mine.safetensors", 64), "torchrl_ppo": (1,)}
# TorchRL is in no extra, and warns of what is old in itself.
TORCHRL = [
    pytest.mark.skipif(importlib.util.find_spec("torchrl") is None, reason="no TorchRL: pip install torchrl"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning"),
]


def marked(example):
    """An example, skipped where its library is missing."""
    return pytest.param(example, marks=TORCHRL if example == "torchrl_ppo" else ())


def run(example, *arguments):
    return runpy.run_path(str(ROOT / f"{example}.py"))["main"](*arguments)


@pytest.mark.filterwarnings("ignore:.*does not keep the control period")  # the machine does other things besides
@pytest.mark.parametrize("example", [marked(path.stem) for path in sorted(ROOT.glob("*.py"))])
def test_example(example, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(example, *SMALL[example])
    assert capsys.readouterr().out.strip()
    assert [path.name for path in tmp_path.iterdir()] == ["mine.safetensors"] * (example == "sac")


def test_the_policy_of_the_example_follows():
    rows = run("own_policy", 1)
    assert [row.policy.rpartition(":")[2] for row in rows] == ["Damped", "qp"]
    assert all(row.followed for row in rows)


@pytest.mark.slow
@pytest.mark.parametrize("example", [marked("torchrl_ppo")])
def test_agents_of_examples_learn(example):
    """Without training the score is 0 to 0.02, after 60 of 200 updates 0.1 to 0.2."""
    assert run(example, 60) > 0.08
