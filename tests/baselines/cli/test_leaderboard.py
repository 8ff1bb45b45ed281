"""The commands that compare policies: leaderboard and robustness."""

import csv

import pytest

from baselines.cli.commands import leaderboard, robustness
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError


def lines_of(file):
    with file.open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))


def test_leaderboard_plays_and_resumes(tmp_path, capsys):
    policies = ["dls", "broyden", "agent_alone"]
    words = ["--scenarios", "zhang3-helix", "--policies", *policies, "--out", str(tmp_path), "--timed", "1"]
    assert leaderboard.main(words) == 0
    printed = capsys.readouterr().out
    assert "skipped: agent_alone in zhang3-helix: " in printed
    assert printed.endswith(f"written to {tmp_path}\n")
    lines = lines_of(tmp_path / "table.csv")
    assert [line["policy"] for line in lines] == ["dls", "broyden"]
    assert all(f"`{line['policy']}`" in printed for line in lines)
    assert {"table.md", "cost-time-zhang3-helix.png", "foresight.png", "results.json", "report.html"} <= {
        file.name for file in tmp_path.iterdir()
    }
    assert leaderboard.main(words) == 2
    assert "--resume" in capsys.readouterr().err
    assert leaderboard.main([*words, "--resume"]) == 0
    assert lines_of(tmp_path / "table.csv") == lines


def test_leaderboard_takes_test_sets_or_scenarios(tmp_path, capsys):
    words = ["--scenarios", "varga7-fast", "--test-sets", "varga7-random", "--out", str(tmp_path)]
    assert leaderboard.main(words) == 2
    assert "expected --test-sets or --scenarios" in capsys.readouterr().err


@pytest.mark.slow
def test_robustness_draws_a_map(tmp_path, capsys):
    short, out = tmp_path / "short.toml", str(tmp_path)
    scenarios.get("panda-field").replace(steps=300).save(short)
    words = ["--scenario", str(short), "--policies", "dls", "--severities", "0", "1", "--episodes", "1", "--out", out]
    assert robustness.main(words) == 0
    cells = {(line["knowledge"], line["drives"]): line for line in lines_of(tmp_path / "map.csv")}
    assert set(cells) == {(k, d) for k in ("0.0", "1.0") for d in ("0.0", "1.0")}
    ideal, worst = (float(cells[place]["cost_ratio"]) for place in (("0.0", "0.0"), ("1.0", "1.0")))
    assert 1.0 <= ideal < worst
    assert (tmp_path / "map.png").exists()
    assert "× ideal" not in capsys.readouterr().out


def test_severities_scale_the_plant():
    assert robustness.at("panda-field", 0.0, 0.0).plant.ideal
    assert robustness.at("panda-bus", 0.5, 1.0).name == "panda-bus 0.5 1"
    with pytest.raises(InvalidInputError, match="not ideal"):
        robustness.at("varga7-fast", 1.0, 1.0)
