"""The wheel is complete: what is documented works where there is nothing but what it holds."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest
from hatchling.builders.wheel import WheelBuilder

ROOT = Path(__file__).parents[1]
PACKAGES = ("ikgym", "baselines")
#: What commands read: data, the files that say how agents are trained, and the parts of a report.
DATA = (".json", ".toml", ".yml", ".safetensors", ".typed", ".npz", ".txt", ".html", ".css", ".js")


@pytest.fixture(scope="module")
def content() -> set[str]:
    """The files that the wheel would hold."""
    return {file.distribution_path for file in WheelBuilder(str(ROOT)).recurse_included_files()}


def test_it_holds_every_module_and_all_data(content):
    for package in PACKAGES:
        files = {path.relative_to(ROOT).as_posix() for path in (ROOT / package).rglob("*") if path.is_file()}
        assert {file for file in files if file.endswith((".py", *DATA))} <= content
    assert {file for file in content if not file.endswith(".py")} <= {file for file in content if file.endswith(DATA)}
    for file in ("best_known.json", "ranges.toml", "agents/agent_alone.safetensors", "agents/agent_track.safetensors"):
        assert f"baselines/data/{file}" in content
    assert "baselines/training/presets.toml" in content
    # The problems of others, and the notices that their licences ask for.
    for file in ("problems.npz", "LICENSE-RL-ITG.txt", "LICENSE-CppFlow.txt"):
        assert f"ikgym/problems/{file}" in content


def test_it_holds_nothing_else(content):
    assert {file.partition("/")[0] for file in content} == set(PACKAGES)


def test_every_documented_module_can_be_imported(content):
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    named = set(re.findall(r"python -m ([\w.]+)", text)) | set(re.findall(r"(?:from|import) ([\w.]+)", text))
    named = {name.rstrip(".") for name in named if name.partition(".")[0] in PACKAGES}
    assert {"ikgym", "baselines"} <= named
    for name in named:
        found = importlib.util.find_spec(name)
        assert found is not None, name
        assert Path(found.origin).relative_to(ROOT).as_posix() in content


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """An environment that holds the wheel, and sees the dependencies of this one, but not this tree."""
    folder = tmp_path_factory.mktemp("wheel")
    quiet = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*quiet, "wheel", "--no-build-isolation", "--no-deps", "-w", str(folder), str(ROOT)], check=True)
    (wheel,) = folder.glob("*.whl")
    venv.create(folder / "venv", with_pip=False, symlinks=True)
    binaries = folder / "venv" / "bin"
    site = Path(
        subprocess.run(
            [binaries / "python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
            check=True,
            capture_output=True,
            text=True,
        ).stdout.strip()
    )
    # The path alone: what lies there as .pth files, such as that of an editable installation, is not heeded.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    target = [*quiet, "--python", str(binaries / "python"), "install", "--no-deps", "--no-index", "--force-reinstall"]
    subprocess.run([*target, "--ignore-installed", str(wheel)], check=True)
    # Kernels of the same source have the same machine code.
    for code in (code for package in PACKAGES for code in (ROOT / package).rglob("__pycache__/*.nb[ic]")):
        (copy := site / code.relative_to(ROOT)).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(code, copy)
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()

    def run(*command: str) -> subprocess.CompletedProcess[str]:
        kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "NUMBA_CACHE_DIR")}
        done = subprocess.run(
            [str(binaries / command[0]), *command[1:]],
            cwd=elsewhere,
            env={**kept, "COLUMNS": "80"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done

    return run, site, elsewhere


@pytest.mark.slow
def test_the_environment_runs_from_the_wheel(installed):
    run, site, _ = installed
    code = (
        "import gymnasium, baselines\n"
        "env = gymnasium.make('ikgym:RedundantIK-v0', scenario='varga7-fast', preview=1)\n"
        "observation, _ = env.reset(seed=0)\n"
        "policy = baselines.make('dls', 'varga7-fast')\n"
        "action, state = policy.predict(observation)\n"
        "print(env.step(action)[1] < 0)\n"
        "import ikgym; print(ikgym.__file__, baselines.__file__)"
    )
    answer, places = run("python", "-c", code).stdout.splitlines()
    assert answer == "True"
    assert all(Path(place).is_relative_to(site) for place in places.split())


@pytest.mark.slow
def test_agents_are_evaluated_from_the_wheel(installed):
    run, _, folder = installed
    policies = ("dls", "agent_alone")
    done = run("ikgym", "evaluate", "--scenarios", "varga7-random", "--policies", *policies, "--out", "out")
    assert "varga7-random" in done.stdout
    rows = json.loads((folder / "out" / "results.json").read_text())
    rows = rows["rows"] if isinstance(rows, dict) else rows
    assert [row["policy"] for row in rows] == list(policies)
    assert all(row["cost_ratio"] > 0.9 for row in rows)
    assert (folder / "out" / "report.html").exists()


@pytest.mark.slow
def test_an_agent_is_trained_from_the_wheel(installed):
    run, _, folder = installed
    tiny = "--env ikgym/Track-v0 --total-timesteps 512 --validations 1 --episodes 2 --out runs"
    run("ikgym", "train", "ppo", *tiny.split())
    agent = folder / "runs" / "seed-0" / "agent.safetensors"
    assert agent.is_file()
    done = run("ikgym", "evaluate", "--scenarios", "learning-track", "--policies", f"agent:{agent}", "--steps", "5")
    assert "agent" in done.stdout


@pytest.mark.slow
def test_lists_come_from_the_wheel(installed):
    run, _, _ = installed
    lists = "[main([word]) for word in ('arms', 'scenarios', 'policies')]"
    text = run("python", "-c", f"from baselines.cli import main; {lists}").stdout
    assert all(name in text for name in ("fetch_arm", "khan8-q1", "rhc_foresight"))
