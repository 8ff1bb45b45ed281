"""The viewer serves a page, shows what the session says, does what a browser asks, and ends."""

import re
import socket
import sys
import time
import urllib.error
import urllib.request

import numpy as np
import pytest

from baselines.cli import main
from baselines.viewer.replay import Stage
from baselines.viewer.session import Mode, Session

pytest.importorskip("viser")
import msgspec
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from baselines.viewer import server as servers
from tests.baselines.viewer.conftest import HOST

PATIENCE = 60.0  # [s]: the machine may have other work


class Browser:
    """What a page of viser's says to the server, in version 0.2 of it, which our constraints have."""

    def __init__(self, connection):
        self.connection = connection
        self.say(
            "ViewerCamera", wxyz=[1, 0, 0, 0], position=[3, 0, 1], fov=1.0, near=0.1, far=99.0, aspect=1.0,
            look_at=[0, 0, 0], up_direction=[0, 0, 1],
        )  # fmt: skip

    def say(self, kind, **content):
        self.connection.send(msgspec.msgpack.encode({"type": f"{kind}Message", **content}))

    def set(self, control, value):
        self.say("GuiUpdate", uuid=control._impl.uuid, updates={"value": value})

    def drag(self, target, position):
        self.say("TransformControlsUpdate", name=target.name, wxyz=target.wxyz.tolist(), position=position.tolist())


def test_pages_of_other_origins_are_refused(server):
    port, address = server.get_port(), f"{HOST}:{server.get_port()}"

    for origin in (f"http://{address}", None):
        with connect(f"ws://{address}", origin=origin):
            pass
    for origin in ("http://example.org", f"http://{HOST}:{port + 1}", f"http://{address}.example.org", "null"):
        with pytest.raises(InvalidStatus, match="403"), connect(f"ws://{address}", origin=origin):
            pass
    assert urllib.request.urlopen(f"http://{address}/").status == 200


@pytest.fixture
def viewer(server):
    return servers.Viewer(server, Session(Stage.of("panda-circle", steps=20), ["dls", "qp"]))


def wait_for(viewer, condition):
    """Shows pictures in which no time passes until something has come about."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"nothing has come of it in {PATIENCE} s"
        time.sleep(0.005)
        viewer.tick(0.0)


def test_a_browser_is_told_the_scene_and_its_controls_do_what_they_say(server, viewer):
    session, target = viewer.session, viewer.drawing.target
    with connect(f"ws://{HOST}:{server.get_port()}", max_size=None, max_queue=None) as connection:
        browser, received = Browser(connection), b""
        wait_for(viewer, server.get_clients)
        while not all(name in received for name in (b"/policy_1", b"joint_6", b"panda-circle**, seed 0", b"Play")):
            received += connection.recv(timeout=PATIENCE)
        browser.set(viewer.play, True)
        wait_for(viewer, lambda: session.playing)
        browser.set(viewer.time, 0.012)
        wait_for(viewer, lambda: session.step == 12)
        assert not session.playing
        browser.set(viewer.joints[3], -1.0)
        wait_for(viewer, lambda: session.mode is Mode.HAND)
        assert session.views()[0].scene.q[3] == -1.0
        session.scrub(0.0)
        viewer.tick(0.0)
        browser.drag(target, target.position + np.array([0.0, 0.0, 0.01]))
        wait_for(viewer, lambda: session.mode is Mode.FOLLOW)
    viewer.tick(0.01)
    assert session.reference[11] > session.stage.frames[0, 11]


def test_what_is_played_is_shown(viewer):
    viewer.session.toggle()
    viewer.tick(0.01)
    session = viewer.session
    np.testing.assert_allclose(viewer.drawing.target.position, session.stage.frames[10, 9:], atol=1e-12)
    frame = viewer.drawing._arms[1]._frames[2]
    q = session.replays[1].q[10]
    turned = [np.cos(q[2] / 2), *(np.sin(q[2] / 2) * session.stage.scenario.arm.axes[2])]
    np.testing.assert_allclose(frame.wxyz, turned, atol=1e-6)  # viser leaves out what is nearly the same


def test_what_the_program_sets_is_not_taken_for_a_user(viewer):
    viewer.session.scrub(0.01)
    viewer.tick(1.0)  # readings and sliders are due
    viewer.tick(0.0)
    assert viewer.session.mode is Mode.PLAY
    assert viewer.joints[0].value == pytest.approx(viewer.session.views()[0].scene.q[0], abs=1e-4)
    assert "dls" in viewer.readings.content


def test_a_picture_leaves_the_target_in_the_hand_that_drags_it(viewer):
    session, target = viewer.session, viewer.drawing.target
    start = target.position.copy()
    np.testing.assert_allclose(start, session.stage.frames[0, 9:], atol=1e-12)
    target.position = start + 0.01
    viewer.tick(0.0)
    np.testing.assert_allclose(target.position, start + 0.01)
    session.aim(np.append(session.reference[:9], target.position))
    viewer.tick(0.0)
    np.testing.assert_allclose(target.position, start + 0.01)
    session.toggle()  # back to the episode
    viewer.tick(0.0)
    np.testing.assert_allclose(target.position, start)


def test_it_runs_until_it_is_told_to_stop(capsys, monkeypatch):
    ticked, tick = [], servers.Viewer.tick

    def last(viewer, seconds):
        ticked.append(seconds)
        tick(viewer, seconds)
        if len(ticked) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(servers.Viewer, "tick", last)
    assert main(["view", "--scenario", "panda-circle", "--steps", "2", "--port", "0"]) == 130
    assert len(ticked) == 3
    port = int(re.search(r"http://127.0.0.1:(\d+)", capsys.readouterr().out)[1])
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(f"http://{HOST}:{port}", timeout=PATIENCE)


def test_a_port_in_use_is_an_error(capsys):
    with socket.socket() as taken:
        taken.bind((HOST, 0))
        taken.listen()
        assert main(["view", "--steps", "2", "--port", str(taken.getsockname()[1])]) == 2
    assert "port: expected one that is free" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--policy", "dlss"], "Did you mean 'dls'?"),
        (["--port", "70000"], "port: expected"),
        (["--urdf", "nowhere.urdf"], "Cannot read nowhere.urdf"),
    ],
)
def test_mistakes(options, message, capsys):
    port = [] if "--port" in options else ["--port", "0"]
    assert main(["view", "--steps", "2", *port, *options]) == 2
    assert message in capsys.readouterr().err


def test_without_it_the_extra_is_named(capsys, monkeypatch):
    for name in [name for name in sys.modules if name.startswith("baselines.viewer.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "viser", None)
    assert main(["view", "--steps", "2", "--port", "0"]) == 2
    assert 'This needs viser: pip install "ikgym[view]"' in capsys.readouterr().err
