"""The ways to name a scenario: an object, a registered name, a file, a place in a module."""

import pathlib
import sys

import gymnasium as gym
import pytest

import baselines
import ikgym
from baselines.cli import main
from ikgym import scenarios
from ikgym.exceptions import IkgymError
from ikgym.sb3 import RedundantIKVecEnv

FAST = scenarios.get("varga7-fast")
MODULE = """
import ikgym

SHORT = ikgym.scenarios.get("varga7-fast").replace(name="short", steps=3)

def make_short():
    return SHORT

def fail():
    return 1 / 0

number = 3
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with a file and a module of the user."""
    monkeypatch.chdir(tmp_path)
    FAST.replace(name="short", steps=3).save("short.toml")
    (tmp_path / "my_scenarios.py").write_text(MODULE)
    (tmp_path / "my_faulty.py").write_text("import no_such_module")
    (tmp_path / "my_package").mkdir()
    (tmp_path / "my_package" / "arms.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in ("my_scenarios", "my_faulty", "my_package", "my_package.arms"):
        sys.modules.pop(name, None)


ITEMS = [
    "short.toml",
    pathlib.Path("short.toml"),
    "my_scenarios:SHORT",
    "my_scenarios:make_short",
    "my_package.arms:make_short",
    FAST.replace(name="short", steps=3),
]


@pytest.mark.parametrize("item", ITEMS, ids=str)
def test_find(folder, item):
    found = scenarios.find(item)
    assert (found.name, found.steps, found.arm.name) == ("short", 3, "varga7")


def test_the_command_line_searches_the_current_folder(folder, monkeypatch, capsys):
    monkeypatch.setattr(sys, "path", [place for place in sys.path if place not in ("", str(folder))])
    assert main(["evaluate", "--scenarios", "my_scenarios:SHORT", "--policies", "dls"]) == 0
    assert "short" in capsys.readouterr().out


def test_registered_names_take_precedence(folder, own_registries):
    scenarios.register("short.toml", lambda: FAST)
    scenarios.register("my_scenarios:SHORT", lambda: FAST)
    assert scenarios.find("short.toml") is scenarios.find("my_scenarios:SHORT") is FAST


@pytest.mark.parametrize(
    ("item", "message"),
    [
        ("varga7-fats", "Did you mean 'varga7-fast'"),
        (3, "expected a Scenario, its name"),
        (None, "got None"),
        ("shot.toml", "Cannot read"),
        ("my_scenarios:SHOT", "Did you mean 'SHORT'"),
        ("my_scenarios:number", "expected its maker to give an object of Scenario, got 3"),
        ("my_scenarios:fail", "ZeroDivisionError: division by zero"),
        ("no_such:x", "cannot be imported"),
        ("my_faulty:x", "cannot be imported: .*no_such_module"),
        *((item, "expected 'package.module:attribute'") for item in ("my_scenarios:", ":x", "a b:x")),
    ],
)
def test_bad_items(folder, item, message):
    with pytest.raises(IkgymError, match=message):
        scenarios.find(item)


@pytest.mark.parametrize("item", ["short.toml", "my_package.arms:make_short"])
def test_all_that_takes_a_scenario_finds_it(folder, item):
    assert gym.make("RedundantIK-v0", scenario=item).unwrapped.scenario.steps == 3
    assert gym.make_vec("RedundantIK-v0", num_envs=2, scenario=item).unwrapped.scenario.steps == 3
    assert RedundantIKVecEnv(2, item).scenario.steps == 3
    policy = baselines.make("dls", item)
    observation, _ = ikgym.RedundantIKEnv(item, policy.preview).reset()
    assert policy.predict(observation)[0].shape == (7,)
