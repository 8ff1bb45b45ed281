"""Prose, tables and snippets hold: they are executed, or compared with what the code says."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines import cli, registry
from baselines.cli import main
from baselines.evaluate import evaluate
from baselines.oracle import best_known
from baselines.oracle.best_known import beaten_record
from baselines.papers import PAPERS
from docs.tables import PAGES, fill_in
from docs.terminal import manual_of
from docs.tutorial import PAGES as TUTORIALS

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
WRITTEN = sorted(PAGES.rglob("*.md"))
PROSE = [*ROOT.glob("*.md"), *WRITTEN]


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: str(page.relative_to(PAGES)))
def test_tables_are_up_to_date(page):
    text = page.read_text(encoding="utf-8")
    assert fill_in(text) == text, "write the tables anew with: python -m docs.tables"


def test_every_picture_and_every_table_of_results_is_shown():
    text = "".join(page.read_text(encoding="utf-8") for page in PROSE)
    pictures = [file.relative_to(PAGES).as_posix() for file in (PAGES / "images").rglob("*.png")]
    tables = [file.name for file in (PAGES / "results").glob("*.csv")]
    assert [name for name in [*pictures, *tables] if name not in text] == []


def files() -> dict[str, str]:
    """The files of the README, by their names."""
    return dict(re.findall(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", README, re.DOTALL))


def commands() -> list[list[str]]:
    """The command lines of the README that begin with ``ikgym``, each as its words."""
    blocks = "".join(re.findall(r"```sh\n(.*?)```", README, re.DOTALL))
    return [shlex.split(line, comments=True)[1:] for line in blocks.splitlines() if line.startswith("ikgym ")]


def statements(snippet: str) -> list[str]:
    """Its lines without imports and without empty ones."""
    return [line for line in snippet.splitlines() if line.strip() and not line.startswith(("import", "from"))]


@pytest.mark.usefixtures("one_thread")
def test_readme_snippets_run(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    snippets = [snippet for snippet in re.findall(r"```python\n(.*?)```", README, re.DOTALL) if "class" not in snippet]
    assert len(snippets) == 2
    for snippet in snippets:
        assert len(statements(snippet)) <= 10
        # 1,600,000 steps take minutes.
        exec(snippet.replace("envs).learn(1_600_000)", "envs, n_steps=8).learn(64)"), {})
    printed = capsys.readouterr().out
    assert snippets[1].count("envs).learn(1_600_000)") == 1
    assert baselines.make("agent", "panda-random", path="mine.safetensors").preview == (5, 25)
    assert "'nominal': (2, 6)" in printed
    cost = float(re.search(r"cost (\S+)", printed)[1])
    assert cost == pytest.approx(cells("varga7-fast")["dls"]["total cost"], rel=1e-3)


#: What holds after the snippets of a page have run one after the other, in an empty folder.
SNIPPETS: dict[str, str] = {
    "scenarios.md": "converged and len(greedy) == len(problem.positions) and driven.duration == found.duration and "
    "np.allclose(arm.forward(q)[1], position + [0.1, 0.2, -0.1], atol=1e-9) and "
    "ikgym.scenarios.load('mine.toml').steps == scenario.steps",
    "bodies.md": "0.0 < distance < 0.2 and len(ikgym.scenarios.load('mine.toml').obstacles) == 2",
    "policies.md": "[row.policy for row in rows] == ['proportional', 'proportional', 'dls'] and "
    "adapted.total_cost < 0.01 * alone.total_cost",
    "evaluation.md": "trajectory.q.shape == (200, 7) and (row.policy, row.preview) == ('Still', 2) and "
    "[one.parameters['damping'] for one in rows][1] == 0.01",
    "real-arm.md": "controller.stopped is None and max(controller.drives.delay) < 0.01 and np.allclose("
    "scenario.task.coordinates(*scenario.arm.forward(q)), reference[1000], atol=1e-5)",
    **{f"papers/{paper}.md": "True" for paper in PAPERS},
    "agents.md": "True",
}


@pytest.mark.filterwarnings("ignore:predicted does not keep")  # the machine may be busy
@pytest.mark.parametrize(
    "page", [pytest.param(p, marks=pytest.mark.slow if p == "agents.md" else ()) for p in SNIPPETS]
)
def test_snippets_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for where, parts in ((ikgym.scenarios._registry, ("_makers", "_made")), (registry, ("_import_paths", "_classes"))):
        for part in parts:
            monkeypatch.setattr(where, part, dict(getattr(where, part)))
    names = {"__name__": __name__, "np": np, "ikgym": ikgym}
    for snippet in re.findall(r"```python\n(.*?)```", (PAGES / page).read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(snippet, page, "exec", dont_inherit=True), names)
    assert eval(SNIPPETS[page], names)


def test_no_page_has_snippets_that_nobody_runs():
    run = {ROOT / "README.md", *TUTORIALS, *(PAGES / name for name in SNIPPETS)}
    assert {page for page in PROSE if "```python" in page.read_text(encoding="utf-8")} <= run


def test_the_policy_of_the_readme_follows_the_reference():
    snippet = files()["mine.py"]
    assert len(statements(snippet)) <= 15
    names: dict = {}
    exec(snippet, names)
    scenario = ikgym.scenarios.get("varga7-slow").replace(steps=200)
    policy = names["Proportional"](scenario)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=policy.preview)
    (observation, _), state, errors = env.reset(seed=0), None, []
    for _ in range(scenario.steps):
        action, state = policy.predict(observation, state)
        observation, *_, info = env.step(action.astype(np.float32))
        errors.append(info["position_error"])
    assert max(errors) < 2e-3  # [m], on a path of meters


def test_what_is_ones_own_is_evaluated_by_one_command_each(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    names = files()
    for name, text in names.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    wanted = [words for words in commands() if words[0] == "evaluate" and any("mine" in word for word in words)]
    assert len(wanted) == 2
    for words in wanted:
        assert main([*words, "--steps", "20"]) == 0
    printed = capsys.readouterr().out
    assert "mine:Proportional" in printed
    assert "mine: 20 steps" in printed


def test_commands_of_the_documentation_exist():
    text = "\n".join(page.read_text(encoding="utf-8") for page in PROSE if page.name != "CHANGELOG.md")
    for word in re.findall(r"^(?:\$ )?ikgym (\w+)|`ikgym (\w+)", text, re.MULTILINE):
        assert max(word) in {*cli.COMMANDS}


#: Other forms of ``ikgym WORD``, where Python runs a module or a file.
OTHERWISE = {
    "python -m baselines.optimum": "ikgym oracle",
    "python -m baselines.": "ikgym ",
    "python train.py": "ikgym train",
}


def lines_for_the_terminal(page: Path) -> list[str]:
    """The commands in a page's blocks of ``sh`` that ``ikgym`` knows as well."""
    blocks = "".join(re.findall(r"```sh\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))
    lines = blocks.replace("\\\n", " ").splitlines()
    for one, other in OTHERWISE.items():
        lines = [line.replace(one, other) for line in lines]
    known = {*cli.COMMANDS}
    return [line for line in lines if re.match(r"ikgym (\w+)( |$)", line) and line.split()[1] in known]


@pytest.mark.parametrize("page", [page for page in PROSE if lines_for_the_terminal(page)], ids=lambda page: page.stem)
def test_options_of_commands_exist(page):
    for line in lines_for_the_terminal(page):
        words = shlex.split(line, comments=True)[1:]
        which = words[:2] if words[0] == "train" and not words[1].startswith("-") else words[:1]
        options = {word.partition("=")[0] for word in words if word.startswith("--")} - {"--help"}
        assert options <= set(re.findall(r"--[\w-]+", manual_of(*which))), line


def cells(scenario: str) -> dict[str, dict[str, float]]:
    """The README's table of a scenario of the demo: policy, column, number."""
    table = re.search(rf"<!-- demo: {scenario} -->\n(.*?)<!-- end -->", README, re.DOTALL)[1].strip()
    head, _, *lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    return {
        line[0].split()[0]: {
            key: float(value) if re.match(r"[\d.]", value) else value for key, value in zip(head, line, strict=True)
        }
        for line in lines
    }


@pytest.mark.slow  # the first snippet of the README prints one of these costs
@pytest.mark.parametrize("scenario", ["panda-turn", "varga7-fast"])
def test_readme_tables_are_what_the_demo_prints(scenario):
    shown = cells(scenario)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert scenario in makefile
    rows = evaluate(scenario, re.search(r"^DEMO := (.*)$", makefile, re.MULTILINE)[1].split())
    assert list(shown) == [row.policy for row in sorted(rows, key=lambda row: row.total_cost)]
    assert not any(map(beaten_record, rows)), f"write them down with: {best_known.UPDATE}"
    for row in rows:
        # Where the path was lost, or nothing but rounding is left, another processor may print other digits.
        lost = row.position_error_max > 1.0
        for key, value in {
            "total cost": row.total_cost,
            "pos max [mm]": 1e3 * row.position_error_max,
            "ori max [mrad]": 1e3 * row.orientation_error_max,
            "q̇ peak": row.qdot_peak,
        }.items():
            if value < 1e-3:
                assert shown[row.policy][key] < 1e-3
            else:
                assert shown[row.policy][key] == pytest.approx(value, rel=0.5 if lost else 2e-3), (row.policy, key)
        assert shown[row.policy]["followed"] == ("yes" if row.followed else "no")
        assert shown[row.policy]["solver status"] == row.solver_status


@pytest.mark.parametrize("page", PROSE, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_commands_exist(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        if "://" not in target:
            assert (page.parent / target).exists(), target
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"(?:^|`)make (\w+)", text, re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
    if page.name != "CHANGELOG.md":  # which names files of former versions
        for path in re.findall(r"`((?:ikgym|baselines|docs|tests|benchmarks|examples)/[\w./]*)`", text):
            assert (ROOT / path).exists(), path


def test_make_help_lists_every_target():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    phony = re.search(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)[1].split()
    assert set(re.findall(r"^(\w+):.*##", makefile, re.MULTILINE)) == set(phony)


def test_check_does_everything_in_order():
    command = ["make", "--dry-run", "--always-make", "check"]
    lines = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    wanted = ["ruff format --check", "ruff check", "mypy", "lint-imports", '-m "not slow"', "-m slow"]
    places = [next(i for i, line in enumerate(lines) if words in line) for words in wanted]
    assert places == sorted(places)
    assert (ROOT / ".ci" / "run").read_text(encoding="utf-8").rstrip().endswith("make check")


def test_the_citation_is_of_this_version():
    said = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r"^version: (.*)$", said, re.MULTILINE)[1] == ikgym.__version__
