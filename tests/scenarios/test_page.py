"""What docs/scenarios.md says of scenarios in files holds."""

import dataclasses
import re
import tomllib
from pathlib import Path

import numpy as np

import ikgym
from baselines.fingerprints import fingerprint
from ikgym.scenarios import Scenario
from tests.arms.test_urdf import joint, robot

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8").split("## A scenario of your own")[1]
WHOLE, ON_URDF, PLANT, FROM_CSV = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
_, SNIPPET, _ = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


def test_the_example_is_the_file_of_the_examples():
    assert tomllib.loads(WHOLE) == tomllib.loads((ROOT / "examples" / "planar4.toml").read_text(encoding="utf-8"))


def test_the_file_and_the_lines_of_python_give_the_same(tmp_path, monkeypatch, own_registries):
    monkeypatch.chdir(tmp_path)
    Path("page.toml").write_text(WHOLE, encoding="utf-8")
    assert len([line for line in SNIPPET.splitlines() if line and not line.startswith("import")]) <= 10
    exec(SNIPPET, {})
    page, mine = (ikgym.scenarios.load(f"{name}.toml") for name in ("page", "mine"))
    assert ikgym.scenarios.get("planar4-wave").steps == page.steps == mine.steps
    assert page.cost == mine.cost
    np.testing.assert_allclose(page.nominal(), mine.nominal(), rtol=0, atol=1e-12)


def test_the_table_of_keys_is_complete():
    keys = re.findall(r"^\| `(\w+)` \|.*\| (.*) \|$", TEXT.split("### The plant")[0], re.MULTILINE)
    fields = {f.name: f for f in dataclasses.fields(Scenario)}
    assert sorted(key for key, _ in keys) == sorted(fields)
    for key, default in keys:
        needed = fields[key].default is fields[key].default_factory is dataclasses.MISSING
        assert (default == "an error") is needed, key
        if isinstance(fields[key].default, (int, float)):
            assert float(default) == fields[key].default


def test_the_plant_is_read(tmp_path):
    (tmp_path / "x.toml").write_text(WHOLE + PLANT, encoding="utf-8")
    plant = ikgym.scenarios.load(tmp_path / "x.toml").plant
    for name, value in tomllib.loads(PLANT)["plant"].items():
        np.testing.assert_array_equal(getattr(plant, name), value)


def test_the_arm_from_a_urdf_is_read(tmp_path):
    arm = tomllib.loads(ON_URDF)["arm"]
    for folder in ("robots", arm["packages"][0]):
        (tmp_path / folder).mkdir(exist_ok=True)
    xml = robot(joint("j1", "base_link", "b"), joint("j2", "b", "flange"), links=("base_link", "b", "flange"))
    (tmp_path / arm["urdf"]).write_text(xml)
    head, trajectory = WHOLE.split("[arm]")[0], "[trajectory]\nkind = 'sinusoid'\namplitude = [0.1, 0.1]\n"
    (tmp_path / "x.toml").write_text(head + ON_URDF + trajectory, encoding="utf-8")
    scenario = ikgym.scenarios.load(tmp_path / "x.toml")
    assert scenario.arm.joints == 2
    np.testing.assert_allclose(scenario.arm.forward([0, 0])[1], [0, 0, 0.1])
    assert scenario.arm.acceleration_limit.tolist() == arm["acceleration_limit"]
    assert scenario.arm.home.tolist() == arm["home"]


def test_the_waypoints_of_a_csv_file_are_read(tmp_path):
    points = [[0.3, 0.0, 0.0], [0.4, 0.2, 0.0], [0.3, 0.4, 0.0]]
    lines = [",".join(map(str, point)) for point in [["x", "y", "z"], *points]]
    (tmp_path / "points.csv").write_text("\n".join(lines))
    head = (
        WHOLE.split("[trajectory]")[0].replace('"pose"', '"position"').replace("[arm]", "start = [0, 0, 0, 0]\n[arm]")
    )
    (tmp_path / "x.toml").write_text(head + FROM_CSV, encoding="utf-8")
    scenario = ikgym.scenarios.load(tmp_path / "x.toml")
    given = {"speed": 0.1, "acceleration": 0.5, "corner_radius": 0.01, "time_law": "trapezoidal"}
    wanted = ikgym.trajectories.through(points, **given)
    np.testing.assert_array_equal(scenario.nominal(), scenario.replace(trajectory=wanted).nominal())
    scenario.save(tmp_path / "y.toml")
    assert fingerprint(ikgym.scenarios.load(tmp_path / "y.toml")) == fingerprint(scenario)
