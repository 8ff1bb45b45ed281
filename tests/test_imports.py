"""What is imported when: one process that does more and more, and says what it has loaded."""

import json
import subprocess
import sys

import pytest

PROCESS = """
import json, os, sys, warnings
import numpy as np, gymnasium

def state():
    environment = dict(os.environ), gymnasium.logger.min_level
    return warnings.filters[:], np.geterr(), np.random.get_state()[1].tolist(), environment

before, opened, loaded = state(), [], {}
sys.addaudithook(lambda event, args: opened.append(str(args[0])) if event == "open" else None)
import ikgym, baselines
same, names = state() == before, baselines.names()

def done(what):
    loaded[what] = sorted(sys.modules)

done("names")
ikgym.RedundantIKEnv("zhang3-helix").reset()
done("environment")
from baselines.cli import main
main(["evaluate", "--policies", "qp", "--steps", "5"])
done("evaluate")
from baselines.cli.commands.train import parse
parse(["sac", "--env", "ikgym/Track-v0", "--out", "x"])
main(["policies"])
done("lists")
env = ikgym.RedundantIKEnv("zhang3-helix", render_mode="rgb_array")
env.reset()
env.render()
done("picture")
print(json.dumps([same, names, opened, loaded]))
"""
LARGE = {"torch", "matplotlib", "plotly", "viser", "ray", "minari", "h5py", "optuna", "moviepy", "trimesh", "yourdfpy"}


@pytest.fixture(scope="module")
def process():
    """Whether global state is as before, the names of policies, opened files, and modules after each thing done."""
    done = subprocess.run([sys.executable, "-c", PROCESS], capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture
def loaded(process):
    return {what: set(modules) for what, modules in process[3].items()}


def test_importing_changes_no_global_state(process):
    assert process[0]


def test_names_import_no_policy_and_read_no_agent(process, loaded):
    _, names, opened, _ = process
    assert {"rhc", "agent_alone", "oracle"} <= {*names}
    families = ("baselines.solvers", "baselines.agents", "baselines.oracle", "baselines.evaluation")
    assert [name for name in loaded["names"] if name.startswith(families)] == []
    assert not LARGE & loaded["names"]
    assert len(opened) > 10
    assert not [file for file in opened if file.endswith(".safetensors")]


def test_no_mode_imports_no_matplotlib_and_pictures_import_no_pyplot(loaded):
    assert not {"matplotlib", "pandas"} & loaded["environment"]
    assert "matplotlib" in loaded["picture"]
    assert "matplotlib.pyplot" not in loaded["picture"]


def test_a_command_imports_what_the_command_line_names(loaded):
    modules = loaded["evaluate"]
    assert not LARGE & modules
    assert [name for name in modules if name.startswith(("ikgym.rl", "ikgym.arms.urdf"))] == []
    others = ("agents", "viewer", "training", "papers", "tuning", "solvers.receding_horizon", "solvers.adaptive")
    assert [name for name in modules if name.startswith(tuple(f"baselines.{one}" for one in others))] == []
    solvers = {name.split(".")[2] for name in modules if name.startswith("baselines.solvers.")}
    shared = {"resolved_rate", "near_bodies", "surroundings"}
    assert {"quadratic_program"} <= solvers <= {"quadratic_program", *shared}
    assert {name for name in modules if name.startswith("baselines.cli.")} == {
        "baselines.cli.commands",
        "baselines.cli.commands.evaluate",
        "baselines.cli.parsing",
        "baselines.cli.shell",
    }


def test_neither_lists_nor_the_command_line_of_training_load_a_learning_library(loaded):
    assert "baselines.cli.commands.train" in loaded["lists"]
    assert not {"torch", "stable_baselines3"} & loaded["lists"]
