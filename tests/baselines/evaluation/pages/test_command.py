"""The command line plays, writes and writes anew; mistakes are one line."""

import io
import re

import PIL.Image
import pytest

from baselines.evaluation.pages import command, entries, families, foresight, sets
from baselines.evaluation.pages.command import main
from baselines.evaluation.pages.entries import Entry, solver
from baselines.evaluation.pages.measurement import Measurement
from tests.baselines.evaluation.pages.builders import write_runs

FEW = (
    solver("dls"),
    solver("dls", {"gain": 0.5}),
    Entry("rhc_foresight", (("rhc_foresight", {"seed": 0}), ("rhc_foresight", {"seed": 1})), (0, 1), timed=1),
)


def assert_picture(file):
    assert PIL.Image.open(io.BytesIO(file.read_bytes())).size[0] > 1000


@pytest.mark.slow
def test_plays_writes_and_writes_anew(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(command, "solvers", lambda *_: FEW)
    monkeypatch.setattr(families, "entries", lambda *_: (solver("dls"), solver("rhc:horizon=3,iterations=1")))
    monkeypatch.setattr(entries, "policy_of", lambda folder: ("dls", {"damping": 10.0 ** -int(folder.name[5:])}))
    write_runs(tmp_path / "ppo", 5, base_policy="dls")
    folder = tmp_path / "page"
    monkeypatch.setattr(foresight, "STEPS", (60, 100))
    monkeypatch.setattr(foresight.entries, "__defaults__", ((60, 100),))
    files = folder / "leaderboard.md", folder / "cost_time.md", folder / "foresight.md"
    arguments = ["--agents", f"PPO from scratch={tmp_path / 'ppo'}", "--sets", sets.MAIN, "--episodes", "1"]
    arguments += ["--out", str(tmp_path / "out"), "--write", str(folder)]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert all(str(file) in printed for file in files)
    texts = [file.read_text(encoding="utf-8") for file in files]
    assert "- PPO from scratch (" in texts[0]
    assert ") corrects `dls` and costs " in texts[0]
    assert "| residual agent |" in texts[0]
    assert "relative to `rhc_foresight`." in texts[0]
    assert "- command: `python -m baselines.leaderboard --agents" in texts[1]
    assert "| 60 | knows the end | " in texts[2]
    for name in ("leaderboard-means", "leaderboard-profiles", f"cost-time-{sets.MAIN}", "foresight"):
        assert_picture(folder / "images" / f"{name}.png")
    measured = Measurement.load(files[0].with_suffix(".json"))
    assert [one.name for one in measured.sections] == list(sets.leaderboard())
    assert len(measured.sections[0].lines[0].cost) == 5
    for file in files:
        file.unlink()
    assert main(["--write", str(folder)]) == 0
    assert [file.read_text(encoding="utf-8") for file in files] == texts
    capsys.readouterr()
    assert main(arguments) == 2
    assert "--resume" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "value", "wanted"), [("--episodes", "0", "episodes"), ("--workers", "0", "workers")]
)
def test_numbers_are_checked_before_anything_is_played(tmp_path, capsys, monkeypatch, option, value, wanted):
    monkeypatch.chdir(tmp_path)
    assert main(["--out", "out", option, value]) == 2
    assert capsys.readouterr().err == f"error: {wanted}: expected a whole number of at least 1, got {value}.\n"
    assert not list(tmp_path.iterdir())


def test_one_page_alone(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(families, "entries", lambda *_: (solver("dls", timed=1),))
    arguments = ["--pages", "cost-time", "--sets", "varga7-fast", "--out", str(tmp_path)]
    assert main(arguments) == 0
    page = tmp_path / "cost_time.md"
    text = page.read_text(encoding="utf-8")
    assert f"`python -m baselines.leaderboard {' '.join(arguments)}`" in text
    assert not (tmp_path / "leaderboard.md").exists()
    page.unlink()
    assert main(["--pages", "cost-time", "--write", str(tmp_path)]) == 0
    assert page.read_text(encoding="utf-8") == text
    capsys.readouterr()
    assert main(arguments) == 2
    assert "--resume" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "--out"),
        (["--write", "nowhere"], r"nowhere.leaderboard\.json"),
        (["--write", "nowhere", "--pages", "cost-time"], r"nowhere.cost_time\.json"),
        (["--write", "nowhere", "--agents", "a=b"], "expected --out"),
        (["--out", "out", "--agents", "a"], "NAME=DIR"),
        (["--out", "out", "--agents", "a=nowhere"], "expected folders seed-0"),
        (["--out", "out", "--pages", "cost-time", "--sets", "varga7-randm"], "Did you mean 'varga7-random"),
    ],
)
def test_what_cannot_be_is_one_line_and_2(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert re.search(message, err)
