"""Training curves are drawn from the validations in `run.json`."""

import json

from baselines.training.curves import curves, main
from baselines.training.folder import FORMAT


def run(folder, seed, costs):
    scores = [{"core_minutes": 0.5 * i, "cost": cost} for i, cost in enumerate(costs)]
    about = {"format": FORMAT, "method": "apg", "seed": seed, "config": {}, "validation": scores}
    (folder / f"seed-{seed}").mkdir(parents=True)
    (folder / f"seed-{seed}" / "run.json").write_text(json.dumps(about), encoding="utf-8")


def test_a_line_a_seed(tmp_path, capsys):
    run(tmp_path / "a", 0, [8.0, 4.0, 2.0])
    run(tmp_path / "a", 1, [9.0, 3.0])
    run(tmp_path / "b", 1, [])  # stopped before its first validation
    (axes,) = curves({"one": tmp_path / "a", "other": tmp_path / "b"}).axes
    assert [line.get_ydata().tolist() for line in axes.lines] == [[1.0, 0.5, 0.25], [1.0, 1.0 / 3.0], []]
    assert axes.lines[1].get_xdata().tolist() == [0.0, 0.5]
    assert axes.get_yscale() == "linear"
    run(tmp_path / "c", 0, [1e8, 1.0])
    assert curves({"one": tmp_path / "c"}).axes[0].get_yscale() == "log"
    file = tmp_path / "curves.png"
    assert main([f"one={tmp_path / 'a'}", "--write", str(file)]) == 0
    assert file.read_bytes().startswith(b"\x89PNG")
    assert main([f"one={tmp_path / 'none'}", "--write", str(file)]) == 2
    assert main(["one", "--write", str(file)]) == 2
    assert "expected NAME=DIR, got 'one'" in capsys.readouterr().err
