"""Submissions: the example is scored, and whatever is missing, damaged or against the rules is refused."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import pathlib
import py_compile
import re
import shutil
import sys

import pytest

from baselines.agents import files
from baselines.evaluation.machine import describe
from baselines.evaluation.pages import command, sets
from baselines.evaluation.pages.measurement import Measurement
from baselines.evaluation.pages.submissions.check import submission
from baselines.evaluation.pages.submissions.manifest import FILE, Manifest, Part
from baselines.files import ResultsError
from tests.baselines.evaluation.pages.builders import DOCS, TEST_SEEDS, a_measurement, a_section, line

EXAMPLE = pathlib.Path(__file__).parents[5] / "examples" / "submission"
MODULE = """
from baselines.solvers.resolved_rate.dls import DampedLeastSquares

class Mine(DampedLeastSquares):
    name = "mine"

class Told(Mine):
    reference = True
"""


@pytest.fixture
def folder(tmp_path):
    """A copy of the example, to be damaged."""
    return pathlib.Path(shutil.copytree(EXAMPLE, tmp_path / "handed-in"))


@pytest.fixture
def docs(tmp_path):
    """A leaderboard of two episodes."""
    (tmp_path / "docs").mkdir()
    a_measurement(a_section(line(), seeds=TEST_SEEDS[:2])).save(tmp_path / "docs" / "leaderboard.json")
    return tmp_path / "docs"


@pytest.fixture
def undrawn(monkeypatch):
    """Leaves plots and text out, which take a while."""
    monkeypatch.setattr(command, "draw_up", lambda found, page, folder: found.save(folder / f"{page}.json"))


def change(folder, pattern, instead):
    file = folder / FILE
    text, count = re.subn(pattern, lambda _: instead, file.read_text(encoding="utf-8"), count=1)
    assert count == 1
    file.write_text(text, encoding="utf-8")


def add(folder, docs, *more):
    out = ["--out", str(docs.parent / "out"), "--write", str(docs), "--pages", "leaderboard"]
    return command.main(["--add", str(folder), *out, *more])


def a_module(folder, text=MODULE, policy="Mine", foresight=1):
    """Makes a folder with a module of it; the name of the module."""
    name = f"module_{hashlib.sha256(str(folder).encode()).hexdigest()[:8]}"
    (folder / f"{name}.py").write_text(text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    (folder / FILE).write_text(
        f'name = "mine"\nauthors = ["A. Nother"]\ncommands = ["none"]\nforesight = {foresight}\ntuned_on = []\n'
        f'[[parts]]\nfile = "{name}.py"\nsha256 = "{digest}"\npolicy = "{policy}"\nparameters = {{damping = 0.02}}\n'
    )
    return name


def test_the_example_is_scored_and_stands_on_the_page(docs, capsys, request):
    assert add(EXAMPLE, docs) == 0
    found = Measurement.load(docs / "leaderboard.json")
    mine, other = found.sections[0].ranked()[0], found.sections[0].lines[0]
    assert (mine.name, mine.seeds, mine.preview, mine.episodes) == ("example residual", (0,), 10, 2)
    assert (mine.training.steps, mine.training.base_policy) == ((2048,), "dls:damping=1e-2")
    assert mine.time_p50_us is None  # the page was measured on another machine
    assert other == line()
    page = (docs / "leaderboard.md").read_text(encoding="utf-8")
    assert "| `example residual` | The ikgym developers | `python train.py ppo" in page
    assert page.count("example residual") >= 3
    capsys.readouterr()
    request.getfixturevalue("undrawn")
    assert add(EXAMPLE, docs) == 2
    assert "'example residual' is on the page already: replace it by --overwrite." in capsys.readouterr().err
    assert add(EXAMPLE, docs, "--overwrite") == 0
    assert Measurement.load(docs / "leaderboard.json").sections == found.sections


def test_the_example_is_what_it_says():
    own = Manifest.read(EXAMPLE)
    about = files.load_agent(EXAMPLE / own.parts[0].file).about
    assert about["training"]["training"]["steps"] == own.parts[0].steps
    assert about["processing"]["base_policy"] == own.base_policy
    assert about["training"]["training"]["core_minutes"] == pytest.approx(own.parts[0].core_minutes, rel=0.05)
    assert not submission(EXAMPLE, trust=False).runs_code


@pytest.mark.parametrize(
    ("pattern", "instead", "message"),
    [
        ('name = "example residual"', 'name = "dls"', "the name 'dls' is taken; expected one of its own"),
        ('name = "example residual"', 'name = "rhc"', "the name 'rhc' is taken"),
        ('name = "example residual"', "", "the key 'name' is missing"),
        ('name = "example residual"', 'name = "a|b"', r"name: expected one line of plain text, got 'a|b'"),
        ("authors = .*", "authors = []", "authors: expected at least one, got none"),
        ("authors = ", "autors = ", "the key 'authors' is missing. Did you mean 'authors'?"),
        ("foresight = 10", "foresight = 9", "declares a foresight of 9 steps, and its policy is shown 10 in"),
        ("foresight = 10", "foresight = -1", "foresight: expected at least 0 steps, got -1"),
        ("foresight = 10", 'foresight = "far"', "foresight"),
        ('"validation"', '"test"', "expected some of train, validation, got 'test'; test episodes are not tuned on"),
        ("steps = 2048", "", "expected seed, steps and core_minutes, since it was trained by ppo"),
        ("sha256 = .*", f'sha256 = "{"0" * 64}"', f"expected the sha256 {'0' * 64} of {FILE}, got 5545329a9d9e"),
        ("sha256 = .*", 'sha256 = "5"', "expected a sha256 of 64 hexadecimal digits, got '5'"),
        ("seed-0.safetensors", "seed-1.safetensors", "does not exist. Did you mean"),
        ("seed-0.safetensors", "../seed-0.safetensors", "expected files of the folder itself, got '../seed-0"),
        ("seed-0.safetensors", "/dev/zero", "expected files of the folder itself, got '/dev/zero'"),
        ("seed-0.safetensors", "submission.toml", "expected a file of the kind .safetensors, .zip, .py, got"),
        (r"\[\[parts\]\]", "[[parts", "is damaged"),
        ("seed = 0", "seed = 0\nparameters = {trust = true}", "trust is given on the command line, never by a file"),
        ("seed = 0", "seed = 0\nparameters = {path = 'b.zip'}", "expected no 'path' among the parameters"),
        ('name = "example', 'name = "\u202eexample', "name: expected one line of plain text"),
        ('"The ikgym', '"\u202eikgym', "authors: expected one line of plain text"),
    ],
)
def test_what_is_refused_before_anything_is_played(folder, docs, capsys, pattern, instead, message):
    change(folder, pattern, instead)
    before = (docs / "leaderboard.json").read_bytes()
    assert add(folder, docs) == 2
    assert message in capsys.readouterr().err
    assert (docs / "leaderboard.json").read_bytes() == before
    assert not list(docs.parent.glob("out/**/results.json"))


def test_damaged_folders(folder, tmp_path):
    agent = folder / "seed-0.safetensors"
    agent.write_bytes(agent.read_bytes()[:-1])
    with pytest.raises(ResultsError, match="expected the sha256"):
        submission(folder, trust=False)
    agent.unlink()
    with pytest.raises(ResultsError, match=r"seed-0\.safetensors does not exist"):
        submission(folder, trust=False)
    (folder / FILE).rename(folder / "submision.toml")
    with pytest.raises(ResultsError, match=r"expected a file submission\.toml .* Did you mean 'submision\.toml'\?"):
        submission(folder, trust=False)
    with pytest.raises(ResultsError, match="there is no such folder"):
        submission(tmp_path / "nowhere", trust=False)


def test_a_file_with_the_right_digest_that_is_no_agent(folder, docs, capsys):
    (folder / "seed-0.safetensors").write_bytes(b"nothing")
    change(folder, "sha256 = .*", f'sha256 = "{hashlib.sha256(b"nothing").hexdigest()}"')
    assert add(folder, docs) == 2
    assert "seed-0.safetensors is cut off, or no safetensors file" in capsys.readouterr().err


def test_code_is_run_only_with_trust(folder, docs, undrawn, capsys, tmp_path):
    mark = tmp_path / "was-run"
    name = a_module(folder, f"open({str(mark)!r}, 'w').close()\n{MODULE}")
    assert add(folder, docs) == 2
    assert "runs code of its own in this process. With --trust it is loaded" in capsys.readouterr().err
    assert not mark.exists()
    assert name not in sys.modules
    assert add(folder, docs, "--trust") == 0
    assert mark.exists()
    mine = {one.name: one for one in Measurement.load(docs / "leaderboard.json").sections[0].lines}["mine"]
    assert (mine.training, mine.seeds, mine.preview) == (None, (), 1)


def test_files_of_elsewhere_and_models_that_nobody_trusts(folder, tmp_path):
    agent = folder / "seed-0.safetensors"
    agent.rename(tmp_path / "elsewhere.safetensors")
    agent.symlink_to(tmp_path / "elsewhere.safetensors")
    with pytest.raises(ResultsError, match="expected files of the folder itself, got 'seed-0"):
        submission(folder, trust=False)
    (folder / "seed-0.zip").write_bytes(agent.read_bytes())
    change(folder, "seed-0.safetensors", "seed-0.zip")
    with pytest.raises(ResultsError, match=r"seed-0\.zip runs code of its own in this process"):
        submission(folder, trust=False)


def test_bytecode_beside_a_module_is_not_run(folder, docs, undrawn, tmp_path):
    name, mark, other = a_module(folder), tmp_path / "was-run", tmp_path / "other.py"
    other.write_text(f"open({str(mark)!r}, 'w').close()\n{MODULE}")
    bytecode = importlib.util.cache_from_source(folder / f"{name}.py")
    # Python would run it without a look at the module beside it.
    py_compile.compile(str(other), bytecode, invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH)
    assert add(folder, docs, "--trust") == 0
    assert not mark.exists()


@pytest.mark.parametrize(
    ("policy", "text", "message"),
    [
        ("Told", MODULE, "Told has privileged information, and references are not ranked"),
        ("Other", MODULE, "cannot be imported"),
        ("Mine", f"import helper_of_nobody\n{MODULE}", "cannot be imported: ModuleNotFoundError"),
        ("Mine", "1 / 0", "cannot be imported: ZeroDivisionError"),
        ("Mine", "raise SystemExit(0)", "cannot be imported: SystemExit"),
    ],
)
def test_modules_that_are_refused(folder, docs, capsys, policy, text, message):
    a_module(folder, text, policy)
    (folder / "helper_of_nobody.py").touch()  # has no digest
    assert add(folder, docs, "--trust") == 2
    assert message in capsys.readouterr().err


def test_it_is_timed_on_the_machine_of_the_page_alone(docs, undrawn):
    file = docs / "leaderboard.json"
    content = json.loads(file.read_text())
    content["machine"] = describe()
    file.write_text(json.dumps(content))
    assert add(EXAMPLE, docs) == 0
    (mine,) = (one for one in Measurement.load(file).sections[0].lines if one.learned)
    assert mine.time_p50_us > 0.0
    assert mine.timed == 2


def test_where_results_go_has_to_be_said(capsys):
    assert command.main(["--add", str(EXAMPLE)]) == 2
    assert "--add: expected --out, where the rows go, and --write" in capsys.readouterr().err


def test_the_rules_name_every_key():
    text = (DOCS / "rules.md").read_text(encoding="utf-8")
    keys = [*Manifest.__dataclass_fields__, *Part.__dataclass_fields__]
    assert [key for key in keys if f"`{key}`" not in text] == []
    assert sets.MAIN in command.LEADERBOARDS.values()
