"""Every example runs."""

import importlib.util
import re
import runpy
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1] / "examples"
#: Arguments that make each example short.
SMALL = {
    "ppo": (1,),
    "real_arm": (0.5, 0.02, False),
    "wrappers": (),
    "behaviour_cloning": (2, 3, 1),
    "sac": (64, 3),
    "torchrl_ppo": (1,),
}
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
def test_example(example, capsys, tmp_path):
    run(example, *((tmp_path / "sac",) if example == "sac" else ()), *SMALL[example])
    printed = capsys.readouterr().out
    assert printed.strip()
    if example == "behaviour_cloning":
        first, *_, last = map(float, re.findall(r"loss ([\d.]+)", printed))
        assert last < 0.8 * first
    made = [path.relative_to(tmp_path / "sac").as_posix() for path in sorted(tmp_path.glob("sac/**/*.*"))]
    assert made == (["track-sac.zip", "videos/track-episode-0.mp4"] if example == "sac" else [])


@pytest.mark.slow
@pytest.mark.parametrize("example", [marked("ppo"), marked("torchrl_ppo")])
def test_agents_of_examples_learn(example):
    """Without training the score is 0 to 0.02, after 60 of 240 updates 0.1 to 0.2."""
    assert run(example, 60) > 0.08


def test_the_wrappers_of_the_example_do_what_they_say():
    """The arm stands, so that what is missing is the error of the step; one arm and many are the same."""
    example = runpy.run_path(str(ROOT / "wrappers.py"))
    env, envs = example["one"](), example["many"](2)
    observation, _ = env.reset(seed=0)
    assert observation in env.observation_space
    both, _ = envs.reset(seed=0)
    assert both in envs.observation_space
    np.testing.assert_array_equal(both["missing"][0], observation["missing"])
    _, reward, *_, info = env.step(np.zeros(7, dtype=np.float32))
    assert np.linalg.norm(observation["missing"]) == pytest.approx(1e3 * info["position_error"], rel=1e-9)
    assert reward == pytest.approx(np.tanh(-1e-3 * (info["tracking_cost"] + info["velocity_cost"])))
    _, rewards, *_ = envs.step(np.zeros((2, 7), dtype=np.float32))
    assert rewards[0] == reward


@pytest.mark.slow
def test_a_clone_of_dls_follows_the_path(capsys):
    """On an episode that is not in its data set."""
    run("behaviour_cloning", 16, 5, 1)
    error = re.search(r"^Clone, seed 1000000: cost .*, error up to ([\d.]+) mm$", capsys.readouterr().out, re.MULTILINE)
    assert 0.01 < float(error[1]) < 5.0
