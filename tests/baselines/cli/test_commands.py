"""The console command: every other command behind one word, lists, and mistakes."""

from __future__ import annotations

import re
import sys

import pytest

import baselines
import ikgym
from baselines import cli
from baselines.cli import main
from tests.bodied import crowd


@pytest.fixture(autouse=True)
def called_by_its_name(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["ikgym"])
    monkeypatch.setenv("COLUMNS", "80")


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"]])
def test_help_lists_the_commands(arguments, capsys):
    assert main(arguments) == 0
    text = capsys.readouterr().out
    assert re.findall(r"^  (\w+)  ", text, re.MULTILINE) == [*cli.COMMANDS]
    assert max(map(len, text.splitlines())) <= 80


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == ikgym.__version__


@pytest.mark.parametrize("word", [*cli.COMMANDS])
def test_help_of_each_command(word, capsys):
    with pytest.raises(SystemExit) as ended:
        main([word, "--help"])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    assert f"usage: ikgym {word}" in text
    assert "python -m" not in text.replace("python -m pip", "")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["evalute"], "There is no command 'evalute'. Did you mean 'evaluate'?"),
        (["policies", "dlss"], "There is no policy 'dlss'. Did you mean 'dls'?"),
        (["arms", "varga"], "There is no arm 'varga'. Did you mean 'varga7'?"),
        (["scenarios", "varga7-fats"], "There is no scenario 'varga7-fats'. Did you mean 'varga7-fast'?"),
        (["evaluate", "--steps", "0"], "steps: expected a whole number of at least 1, got 0."),
        (["evaluate", "--workers", "0"], "workers: expected a whole number from 1 to 1000, got 0."),
        (["oracle", "--starts", "-1"], "starts: expected a whole number from 0 to 100000, got -1."),
        (["reproduce", "--paper", "vagra"], "There is no paper 'vagra'. Did you mean 'varga'?"),
        (["reproduce", "--figure", "-1"], "paper 'varga' has no figure -1"),
        (["evaluate", "--polices", "dls"], "Did you mean '--policies'? See ikgym evaluate --help."),
        (
            ["train", "pop", "--out", "x"],
            "no method 'pop'. Did you mean 'ppo'? Available: apg, ppo, sac, td3, recurrent_ppo.",
        ),
        (["train", "--out", "x"], "There is no method '--out'. Available: apg, ppo, sac, td3, recurrent_ppo."),
        (["train", "ppo", "--env", "ikgym/Track-v0"], "Missing from ikgym train ppo: --out."),
        (["train", "ppo", "--out", "x"], "ppo needs an environment: expected --env, one of ikgym/Reach-v0"),
        (["arms", "--name", "varga7"], "See ikgym arms --help."),
        (["arms", "none.urdf"], "Cannot read none.urdf"),
        (["arms", "mine.toml"], "Cannot read mine.toml"),
        (["arms", "mine.xacro"], "There is no arm 'mine.xacro'."),
        (["arms", "panda", "--tip", "hand"], "--tip has no effect without a URDF file."),
        (["compare"], "required"),
        (
            ["compare", "varga7-random"],
            "Expected a path that is the same at every reset, got scenario 'varga7-random'.",
        ),
        (["compare", "pandas", "none.csv", "--speed", "1"], "There is no arm 'pandas'. Did you mean 'panda'?"),
        (["compare", "panda-line", "--tip", "hand"], "--tip has no effect without a CSV file."),
        (["train", "apg", "--preset", "smok", "--out", "x"], "There is no preset 'smok'. Did you mean 'smoke'?"),
        (["--version", "now"], "--version: expected nothing after it, got now."),
    ],
)
def test_a_mistake_is_one_line_and_ends_with_2(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


FIXED = "on a scenario that is the same at every reset"
APG = ["train", "apg", "--preset", "smoke", "--out", "x"]


@pytest.mark.parametrize(
    ("arguments", "option", "otherwise"),
    [
        *((["evaluate"], option, "without --out") for option in (
            "--resume", "--overwrite", "--no-report",
        )),
        (["evaluate"], "--episodes=2", "on scenarios that are the same at every reset"),
        (["evaluate", "--scenarios", "panda-line"], "--split=train", "on scenarios that are the same at every reset"),
        (["evaluate", "--scenarios", "panda-bus"], "--noise-seeds=2", "on plants without noise"),
        (["evaluate", "--test-sets", "varga7-random"], "--pairs", "on ideal plants"),
        (["evaluate", "--cluster", "ray"], "--workers=2", "with --cluster"),
        (["evaluate", "--timed", "all"], "--cluster=ray", "with --timed all"),
        (["evaluate"], "--leaderboard", "without --out"),
        (["dataset", "--scenario=varga7-fast", "--policy=dls", "--episodes=1", "--out=x-v0"], "--split=train", FIXED),
        (["video", "--out", "x.mp4"], "--seed=1", FIXED),
        (["view"], "--seed=1", FIXED),
        (["oracle", "--generations", "0"], "--chains=1", "with --generations 0"),
        (["oracle", "--starts", "0", "--generations", "0"], "--knots=1", "with --starts 0 --generations 0"),
        ([*APG, "--window", "64"], "--reset-distance=1", "with one --window"),
        ([*APG, "--segments", "1"], "--learning-rate-end=1", "in one segment"),
        ([*APG, "--scenario", "varga7-fast"], "--validation-episodes=2", FIXED),
    ],
)  # fmt: skip
def test_an_option_without_effect_is_refused(arguments, option, otherwise, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([*arguments, option]) == 2
    assert capsys.readouterr().err.startswith(f"error: {option.partition('=')[0]} has no effect {otherwise}")
    assert not list(tmp_path.iterdir())


SCENARIOS = (*ikgym.scenarios.names(), *ikgym.scenarios.problems_from_elsewhere())


@pytest.mark.parametrize(
    ("word", "names"), [("arms", ikgym.arms.names()), ("scenarios", SCENARIOS), ("policies", baselines.names())]
)
def test_lists_are_complete_and_fit_and_every_member_is_shown_in_full(word, names, capsys):
    assert main([word]) == 0
    head, rule, *lines = capsys.readouterr().out.splitlines()
    assert head.startswith(word.replace("policies", "policy").removesuffix("s"))
    assert set(rule) == {"-"}
    assert [line.split()[0] for line in lines if not line.startswith(" ")] == list(names)
    # The letters of the terminal: what is set above another letter takes no place.
    assert max(len(re.sub("[\u0300-\u036f]", "", line)) for line in lines) <= 80

    assert main([word, *names]) == 0
    text = capsys.readouterr().out
    assert all(re.search(rf"^{name}\b.*:", text, re.MULTILINE) for name in names)
    assert ":class:" not in text


def test_members_are_shown_and_files_like_members(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    def shown(*words):
        assert main(words) == 0
        return capsys.readouterr().out

    text = shown("policies", "dls")
    assert "    damping: λ, added to J Jᵀ as it is" in text
    assert text.endswith("Defaults:\n  gain = 1.0, above 0 and below 2\n  damping = 0.001, above 0\n")
    text = shown("arms", "varga7")
    assert "varga7: 7 joints, tool at (5.5, 0, 2) m, its x axis along (" in " ".join(text.split())
    assert re.search(r"^joint_3 +prismatic +none +none +none +none$", text, re.MULTILINE)
    assert "bodies" not in text
    ikgym.scenarios.get("panda-edge").replace(name="mine", source="").save("mine.toml")
    assert shown("arms", "mine.toml").startswith("mine.toml: 7 joints")
    text = shown("scenarios", "mine.toml")
    assert text.startswith("mine: 3600 steps of 0.001 s\n\n  arm  ")
    assert re.search(r"^  path takes +3\.5\d* s, the episode 3\.6 s$", text, re.MULTILINE)
    assert re.search(r"^  poses in reach +not all: missed from 1\.\d+ s to 2\.\d+ s, at \(0\.8", text, re.MULTILINE)
    assert "all, taken one by one; ikgym path follows them from the start" in shown("scenarios", "panda-line")
    assert "poses in reach" not in shown("scenarios", "panda-random")


def test_bodies_and_obstacles_are_listed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    crowd().save("mine.toml")
    assert main(["arms", "panda"]) == main(["scenarios", "mine.toml"]) == 0
    text = capsys.readouterr().out
    for line in (
        r"moved by +bodies; \d+ pairs of them can meet",
        r"the base +link0 \(capsule of 0\.\d+ m, radius 0\.\d+ m\)",
        r"  half space +floor",
        r"  sphere +ball \(moves\)",
        r"  bodies +\d+ on the arm, \d+ pairs of which can meet",
    ):
        assert re.search(f"^{line}$", text, re.MULTILINE)
    assert "an arm that touches something is stopped" in text


def test_the_table_fits_the_terminal_and_the_readme_has_the_command(tmp_path, capsys):
    arguments = ["evaluate", "--policies", "dls", "--steps", "5", "--out", str(tmp_path / "out")]
    assert main(arguments) == 0
    printed = capsys.readouterr()
    assert "left out at 80 characters a line: p99, misses" in printed.out
    assert max(map(len, printed.out.split("\n\nwritten to")[0].splitlines())) <= 80
    assert "ikgym evaluate --policies dls --steps 5" in (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
