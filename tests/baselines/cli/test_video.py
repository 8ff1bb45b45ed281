"""The command ``ikgym video``: what is drawn when, and files that can be played."""

import subprocess
import sys

import numpy as np
import pytest

from baselines.cli import main
from baselines.cli.commands.video import pictures
from baselines.viewer.replay import Stage, play_all

WIDTH = 480
WORDS = ["video", "--scenario", "panda-circle", "--steps", "20", "--fps", "100", "--width", str(WIDTH)]


def test_policies_stand_in_two_columns():
    stage, half = Stage.of("panda-circle", steps=30), WIDTH // 2
    (one,) = play_all(stage, ["dls"])
    first, second = pictures(stage, [one], np.array([0, 30]), WIDTH)
    assert first.shape == (half, WIDTH, 3)
    assert (first != second).any()
    (three,) = pictures(stage, [one] * 3, np.array([0]), WIDTH)
    assert three.shape == (WIDTH, 2 * WIDTH, 3)
    for tile in (three[:half, WIDTH:], three[half:, :WIDTH]):
        np.testing.assert_array_equal(tile, first)
    assert (three[half:, WIDTH:] == 255).all()


@pytest.mark.parametrize(("speed", "count"), [("1", 3), ("0.5", 5), ("1.5", 3)])
def test_the_command_writes_a_video(speed, count, tmp_path, capsys):
    pytest.importorskip("moviepy")
    ffmpeg, file = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe(), tmp_path / "new" / "two.mp4"
    assert main([*WORDS, "--speed", speed, "--policy", "dls", "qp", "--out", str(file)]) == 0
    assert f"two.mp4: {count} pictures" in capsys.readouterr().out
    decode = [ffmpeg, "-v", "error", "-i", str(file), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    content = subprocess.run(decode, check=True, capture_output=True).stdout
    frames = np.frombuffer(content, dtype=np.uint8).reshape(-1, WIDTH // 2, 2 * WIDTH, 3)
    assert len(frames) == count
    assert (frames[0] != frames[-1]).any()
    assert list(file.parent.iterdir()) == [file]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--out", "x.gif"], "out: expected a file that ends in .mp4"),
        (["--out", f"{'x' * 250}.mp4", "--policy", "dlss"], "File name too long"),  # before anything is played
        *((["--width", width], "width: expected") for width in ("476", "481", "3844")),
        (["--fps", "0"], "fps: expected"),
        (["--speed", "-1"], "speed: expected"),
        (["--speed", "1e-9"], "fps, speed: expected at most 100000 pictures, got fps 30 and speed 1e-09."),
        (["--policy", "dls", "dlss"], "Did you mean 'dls'?"),  # before dls is played
    ],
)
def test_mistakes(options, message, capsys, tmp_path, monkeypatch):
    pytest.importorskip("moviepy")
    monkeypatch.chdir(tmp_path)
    out = [] if "--out" in options else ["--out", "x.mp4"]
    assert main(["video", "--steps", "2", *out, *options]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_video_that_fails_leaves_the_old_one(tmp_path, capsys, monkeypatch):
    writer, file = pytest.importorskip("moviepy.video.io.ffmpeg_writer"), tmp_path / "old.mp4"
    file.write_bytes(b"old")
    monkeypatch.setattr(writer, "FFMPEG_BINARY", "false")
    assert main([*WORDS, "--policy", "dls", "--out", str(file)]) == 2
    assert "ffmpeg has failed" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "moviepy.video.io.ffmpeg_writer", None)
    assert main([*WORDS, "--out", str(file)]) == 2
    assert 'pip install "ikgym[video]"' in capsys.readouterr().err
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]
