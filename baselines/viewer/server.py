"""The viewer as a server: browsers change the session, and the scene follows."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import http
import queue
import socket
import time
import unittest.mock
import urllib.parse
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import viser
import websockets.asyncio.server
from viser.transforms import SO3

from baselines.evaluation.table import escape_markdown
from baselines.viewer.drawing import Drawing
from baselines.viewer.meshes import Shape
from baselines.viewer.readings import slider_range
from baselines.viewer.session import Mode, PolicyView, Session
from ikgym.exceptions import InvalidInputError

# Updates of the scene and of the readings per second.
PICTURES, READINGS = 30.0, 5.0
# Longest wait in [s] for the server to end.
PATIENCE = 5.0
#: Seconds of the episode per second.
SPEEDS = ("0.02", "0.05", "0.1", "0.25", "0.5", "1", "2", "5", "10", "50")
# Digits behind the point of a slider's value.
DIGITS = 4

_SERVE = websockets.asyncio.server.serve

LEGEND = (
    "Drag the target, or move a joint; *Play* returns to the episode. A joint is yellow near a limit and red at it. "
    "The ball at the tool shows the manipulability, from red (singular) to green."
)


class Viewer:
    """A session in the browser: the scene with meshes or cylinders, and a panel with controls and readings."""

    def __init__(self, server: Any, session: Session, shapes: list[Shape] | None = None) -> None:
        self.session, gui, stage = session, server.gui, session.stage
        # Requests of browsers, which come in threads of the server.
        self._requests: queue.SimpleQueue[Callable[[], object]] = queue.SimpleQueue()
        self.drawing = Drawing(server, session, shapes)
        self.drawing.target.on_update(self._queue_target)
        server.on_client_connect(lambda client: self.drawing.look(client.camera))
        gui.add_markdown(f"**{escape_markdown(stage.scenario.name)}**, seed {stage.seed}\n\n{LEGEND}")
        if session.has_bodies:
            self.bodies = gui.add_checkbox("bodies and obstacles", stage.scenario.collides)
            self._on_user([self.bodies], self.drawing.show_bodies)
        with gui.add_folder("Episode"):
            self.play = gui.add_button("Play")
            self.time = gui.add_slider("time [s]", 0.0, session.duration, session.duration / 1000.0, 0.0)
            speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        with gui.add_folder("Now"):
            self.readings = gui.add_markdown("")
        with gui.add_folder("Joints"):
            self.joints = _sliders(gui, session)
        self.play.on_click(lambda _: self._requests.put(session.toggle))
        self._on_user([self.time], session.scrub)
        self._on_user([speed], lambda chosen: setattr(session, "speed", float(chosen)))
        self._on_user(self.joints, lambda *q: session.place(np.array(q)))
        self._since_reading = 0.0

    def run(self) -> None:
        """Updates the scene until Ctrl-C."""
        before = time.perf_counter()
        while True:
            time.sleep(max(0.0, before + 1.0 / PICTURES - time.perf_counter()))
            now = time.perf_counter()
            self.tick(now - before)
            before = now

    def tick(self, seconds: float) -> None:
        """Handles requests of browsers, advances the session by a time in [s], and updates the page."""
        with contextlib.suppress(queue.Empty):
            while True:
                self._requests.get_nowait()()
        self.session.advance(seconds)
        views = self.session.views()
        self.drawing.show(views)
        self._since_reading += seconds
        if self._since_reading >= 1.0 / READINGS:
            self._since_reading = 0.0
            self._show_panel(views)

    def _show_panel(self, views: Sequence[PolicyView]) -> None:
        """Shows readings, and the joints of the first policy on the sliders."""
        session = self.session
        self.readings.content = session.text(views)
        self.play.label = "Pause" if session.playing else "Play"
        if session.mode is Mode.PLAY:
            _update(self.time, session.time)
        if session.mode is not Mode.HAND:
            for slider, coordinate in zip(self.joints, views[0].scene.q.tolist(), strict=True):
                _update(slider, min(max(coordinate, slider.min), slider.max))

    def _queue_target(self, _: object) -> None:
        # Read at once: the scene may move the target before the request is handled.
        target = self.drawing.target
        rotation, position = SO3(target.wxyz).normalize().as_matrix(), np.array(target.position)
        self._requests.put(lambda: self.session.aim(np.append(rotation, position)))

    def _on_user(self, controls: Sequence[Any], then: Callable[..., object]) -> None:
        """Queues a request with the values of controls when a user, not the program, has moved one of them."""

        def on_move(event: Any) -> None:
            if event.client is not None:
                values = [control.value for control in controls]
                self._requests.put(lambda: then(*values))

        for control in controls:
            control.on_update(on_move)


@contextlib.contextmanager
def serving(host: str, port: int) -> Iterator[Any]:
    """A server of viser on a port, 0 for a free one; stopped at the end."""
    # viser has no such option, and calls the function before it returns.
    same_origin = unittest.mock.patch.object(websockets.asyncio.server, "serve", _serve)
    with same_origin:
        server = viser.ViserServer(host, free_port(host, port), label="ikgym view", verbose=False)
    try:
        yield server
    finally:
        server.stop()
        loop, end = server.get_event_loop(), time.monotonic() + PATIENCE
        while loop.is_running() and time.monotonic() < end:
            time.sleep(0.01)
        if not loop.is_running():
            # viser leaves its tasks and its loop to Python, which complains.
            for task in asyncio.all_tasks(loop):
                task.cancel()
            loop.run_until_complete(asyncio.sleep(0.0))
            loop.close()


def _serve(*args: Any, process_request: Callable[..., Any], **options: Any) -> Any:
    """Serves pages and WebSockets; refuses those that a page of another origin asks for."""
    return _SERVE(*args, process_request=functools.partial(_process, process_request), **options)


def _process(process_request: Callable[..., Any], connection: Any, request: Any) -> Any:
    hosts = request.headers.get_all("Host")
    if any(urllib.parse.urlsplit(origin).netloc not in hosts for origin in request.headers.get_all("Origin")):
        return connection.respond(http.HTTPStatus.FORBIDDEN, "expected a page of the same origin\n")
    return process_request(connection, request)


def free_port(host: str, port: int) -> int:
    """The port, if it is free, or a free one for 0: viser would silently take the next one."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        try:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
        except (OSError, OverflowError) as e:
            raise InvalidInputError(
                f"port: expected one that is free on {host!r}, got {port} ({getattr(e, 'strerror', None) or e})."
            ) from None
        return int(probe.getsockname()[1])


def _sliders(gui: Any, session: Session) -> list[Any]:
    """One slider a joint, from limit to limit and at least to the start."""
    arm, start = session.stage.scenario.arm, session.stage.start
    low, high = slider_range(arm)
    low, high = np.minimum(low, start).tolist(), np.maximum(high, start).tolist()
    units = ["m" if prismatic else "rad" for prismatic in arm.prismatic]
    return [
        gui.add_slider(f"{name} [{units[j]}]", low[j], high[j], (high[j] - low[j]) / 1000.0, float(start[j]))
        for j, name in enumerate(arm.joint_names)
    ]


def _update(control: Any, value: float) -> None:
    """Shows a value if it differs: viser sends it in any case, and slow browsers would undo the user's change."""
    if control.value != (rounded := round(value, DIGITS)):
        control.value = rounded
