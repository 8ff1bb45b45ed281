"""Videos: what is drawn when, and files that can be played."""

import shutil
import subprocess
import sys

import numpy as np
import pytest

from baselines.cli import main
from baselines.files import ResultsError
from baselines.viewer import film
from baselines.viewer.film import moments, pictures, write_video
from baselines.viewer.replay import Stage, play_all

WIDTH = 480


@pytest.fixture(scope="module")
def stage():
    return Stage.of("panda-circle", steps=30)


def test_steps_that_are_drawn(stage):
    assert moments(stage, 100.0, 1.0).tolist() == [0, 10, 20, 30]
    assert moments(stage, 100.0, 0.5).tolist() == [0, 5, 10, 15, 20, 25, 30]
    assert moments(stage, 50.0, 1.25).tolist() == [0, 25, 30]  # the end is always there
    slow = moments(stage, 100.0, 0.05)
    assert (slow[0], slow[-1]) == (0, 30)
    assert len(slow) == 61


def test_policies_stand_in_two_columns(stage):
    (one,) = play_all(stage, ["dls"])
    steps = moments(stage, 50.0, 1.5)
    (alone, *_) = drawn = list(pictures(stage, [one], steps, width=WIDTH))
    assert len(drawn) == 2
    assert alone.shape == (WIDTH // 2, WIDTH, 3)
    (three, *_) = pictures(stage, [one] * 3, steps[:1], width=WIDTH)
    assert three.shape == (WIDTH, 2 * WIDTH, 3)
    np.testing.assert_array_equal(three[: WIDTH // 2, :WIDTH], alone)
    np.testing.assert_array_equal(three[WIDTH // 2 :, :WIDTH], alone)
    assert (three[WIDTH // 2 :, WIDTH:] == 255).all()
    assert (drawn[1] != alone).any()


def decoded(file):
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    decode = [ffmpeg, "-v", "error", "-i", str(file), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    return np.frombuffer(subprocess.run(decode, check=True, capture_output=True).stdout, dtype=np.uint8)


def test_the_command_writes_a_video(tmp_path, capsys):
    pytest.importorskip("moviepy")
    file = tmp_path / "new" / "two.mp4"
    options = ["--scenario", "panda-circle", "--steps", "20", "--fps", "100", "--width", str(WIDTH)]
    assert main(["video", *options, "--policy", "dls", "qp", "--out", str(file)]) == 0
    assert "two.mp4: 3 pictures" in capsys.readouterr().out
    frames = decoded(file).reshape(-1, WIDTH // 2, 2 * WIDTH, 3)
    assert len(frames) == 3
    assert (frames[0] != frames[-1]).any()
    assert list(file.parent.iterdir()) == [file]


def test_a_video_that_breaks_off_leaves_the_old_one(tmp_path):
    pytest.importorskip("moviepy")
    file = tmp_path / "old.mp4"
    file.write_bytes(b"old")

    def breaking():
        yield np.zeros((240, 480, 3), dtype=np.uint8)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_video(file, breaking(), 30.0)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--out", "x.gif"], "out: expected a file that ends in .mp4"),
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


def test_what_is_missing_is_named_before_anything_is_drawn(capsys, monkeypatch, tmp_path):
    config = pytest.importorskip("moviepy.config")
    monkeypatch.setattr(film, "pictures", None)
    monkeypatch.setattr(config, "FFMPEG_BINARY", str(tmp_path / "ffmpeg"))
    assert main(["video", "--out", "x.mp4"]) == 2
    monkeypatch.setitem(sys.modules, "moviepy", None)
    assert main(["video", "--out", "x.mp4"]) == 2
    assert capsys.readouterr().err.count('pip install "ikgym[video]"') == 2


def test_an_ffmpeg_that_fails_is_an_error(tmp_path, monkeypatch):
    writer = pytest.importorskip("moviepy.video.io.ffmpeg_writer")
    monkeypatch.setattr(writer, "FFMPEG_BINARY", shutil.which("false"))
    with pytest.raises(ResultsError, match="ffmpeg has failed"):
        write_video(tmp_path / "x.mp4", [np.zeros((240, 480, 3), dtype=np.uint8)] * 2, 30.0)
    assert list(tmp_path.iterdir()) == []
