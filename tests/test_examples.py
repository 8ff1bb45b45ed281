"""Every example runs."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(ROOT.glob("[0-9]*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example(example, capsys, tmp_path):
    video = tmp_path / "video.mp4"
    small = {"04_video": (video, 40), "06_ppo": (1,), "08_behaviour_cloning": (2, 3, 1)}
    runpy.run_path(str(example))["main"](*small.get(example.stem, ()))
    printed = capsys.readouterr().out
    assert printed.strip()
    if example.stem == "08_behaviour_cloning":
        first, *_, last = map(float, re.findall(r"loss ([\d.]+)", printed))
        assert last < 0.8 * first
    assert video.exists() == (example.stem == "04_video")


@pytest.mark.slow
def test_the_ppo_of_the_example_learns(capsys):
    """Rewards are minus the decimal logarithm of 1 + cost: 0.15 more is a cost of less than three quarters."""
    rewards = runpy.run_path(str(ROOT / "06_ppo.py"))["main"](12)
    capsys.readouterr()
    assert np.mean(rewards[-3:]) > rewards[0] + 0.15


def test_the_wrappers_of_the_example_do_what_they_say():
    """The arm stands, so that what is missing is the error of the step; one arm and many are the same."""
    example = runpy.run_path(str(ROOT / "07_wrappers.py"))
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
    (example,) = (one for one in EXAMPLES if one.stem == "08_behaviour_cloning")
    runpy.run_path(str(example))["main"](16, 5, 1)
    (error,) = re.findall(
        r"^Clone, seed 1000000: cost .*, error up to ([\d.]+) mm$", capsys.readouterr().out, re.MULTILINE
    )
    assert 0.01 < float(error) < 5.0


def test_there_are_examples():
    assert len(EXAMPLES) >= 4
