"""The options of evaluate that compare policies: a ranked table, and a map over severities."""

import csv

import pytest

from baselines.cli.commands.evaluate import main
from baselines.evaluation.jobs import Options, at_severities, plan
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError


def lines_of(file):
    with file.open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))


def test_a_ranking_is_written_printed_and_resumed(tmp_path, capsys):
    policies = ["broyden", "dls", "agent_alone"]
    words = ["--leaderboard", "--scenarios", "zhang3-helix", "--policies", *policies, "--out", str(tmp_path)]
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert "skipped: agent_alone in zhang3-helix: " in printed
    lines = lines_of(tmp_path / "table.csv")
    assert [line["policy"] for line in lines] == ["dls", "broyden"]
    assert (tmp_path / "table.md").read_text(encoding="utf-8") in printed
    assert {"cost-time-zhang3-helix.png", "results.json", "report.html"} <= {file.name for file in tmp_path.iterdir()}
    assert main([*words, "--resume"]) == 0
    assert lines_of(tmp_path / "table.csv") == lines
    assert main([*words[1:], "--overwrite"]) == 0
    assert not (tmp_path / "table.csv").exists()


@pytest.mark.slow
def test_a_map_over_severities(tmp_path, capsys):
    short, out = tmp_path / "short.toml", str(tmp_path)
    scenarios.get("panda-field").replace(steps=300).save(short)
    assert main(["--scenarios", str(short), "--policies", "dls", "--severities", "0", "1", "--out", out]) == 0
    cells = {(line["knowledge"], line["drives"]): line for line in lines_of(tmp_path / "map.csv")}
    assert set(cells) == {(k, d) for k in ("0.0", "1.0") for d in ("0.0", "1.0")}
    ideal, worst = (float(cells[place]["cost_ratio"]) for place in (("0.0", "0.0"), ("1.0", "1.0")))
    assert 1.0 <= ideal < worst
    assert (tmp_path / "map.png").exists()
    assert (tmp_path / "map.md").read_text(encoding="utf-8") in capsys.readouterr().out


def test_severities_scale_the_plant():
    field, bus = scenarios.get("panda-field"), scenarios.get("panda-bus")
    first, *_, last = at_severities(field, (0.0, 1.0))
    assert first.plant.ideal
    assert last.plant == field.plant.scaled(2.0)
    assert at_severities(bus, (1, 0.5))[1].name == "panda-bus 0.5 1"
    for given in ("varga7-fast", [field, bus]):
        with pytest.raises(InvalidInputError, match="severities: expected one scenario whose plant is not ideal"):
            plan(Options(scenarios=given, severities=(1.0,)))
