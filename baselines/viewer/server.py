"""The viewer as a server: browsers change the session, and the scene follows."""

from __future__ import annotations

import asyncio
import contextlib
import queue
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import viser
from viser.transforms import SO3

from baselines.viewer.approach import Pose
from baselines.viewer.panel import Panel
from baselines.viewer.scene import DrawArm, Scene
from baselines.viewer.session import Session
from ikgym.exceptions import InvalidInputError

# Updates of the scene and of the readings per second.
PICTURES, READINGS = 30.0, 5.0
# Longest wait in [s] for a thread of the server to end.
PATIENCE = 5.0


@contextlib.contextmanager
def serving(host: str, port: int) -> Iterator[Any]:
    """A server of viser, stopped at the end.

    Args:
        host: The address to listen on.
        port: The port; 0 for a free one.

    Raises:
        InvalidInputError: It cannot listen there.
    """
    others = set(threading.enumerate())
    server = viser.ViserServer(host, free_port(host, port), label="ikgym view", verbose=False)
    own = [thread for thread in threading.enumerate() if thread.daemon and thread not in others]
    try:
        yield server
    finally:
        server.stop()
        for thread in own:
            thread.join(PATIENCE)
        loop = server.get_event_loop()
        if not (loop.is_running() or loop.is_closed()):
            loop.run_until_complete(_cancel_others())
            loop.close()


async def _cancel_others() -> None:
    """Ends the tasks that viser leaves in its loop; Python would complain about them when it collects the loop."""
    others = asyncio.all_tasks() - {asyncio.current_task()}
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)


class Viewer:
    """A session in the browser.

    Args:
        server: The server of viser.
        session: The session.
        draw: Adds arms to the scene of a server, see :class:`Scene`.
    """

    def __init__(self, server: Any, session: Session, draw: Callable[[Any], DrawArm] | None = None) -> None:
        self.session = session
        self._requests: queue.SimpleQueue[Callable[[], object]] = queue.SimpleQueue()
        self._scene = Scene(server, session, draw and draw(server))
        self._panel = Panel(server, session, self._requests.put)
        target = self._scene.target

        def dragged(_: object) -> None:
            # Read at once: the scene may move the target before the request is handled.
            pose = Pose(SO3(target.wxyz).as_matrix(), np.array(target.position))
            self._requests.put(lambda: session.aim(pose))

        target.on_update(dragged)
        server.on_client_connect(lambda client: self._scene.look(client.camera))
        self._since_reading = 0.0

    def run(self, stop: threading.Event) -> None:
        """Updates the scene until the event is set."""
        before = time.perf_counter()
        while not stop.wait(max(0.0, before + 1.0 / PICTURES - time.perf_counter())):
            now = time.perf_counter()
            self.tick(now - before)
            before = now

    def tick(self, seconds: float) -> None:
        """Handles requests of browsers, advances the session by a time in [s], and updates the scene."""
        with contextlib.suppress(queue.Empty):
            while True:
                self._requests.get_nowait()()
        self.session.advance(seconds)
        shown = self.session.shown()
        self._scene.show(shown)
        self._since_reading += seconds
        if self._since_reading >= 1.0 / READINGS:
            self._since_reading = 0.0
            self._panel.show(shown)


def free_port(host: str, port: int) -> int:
    """The port, if it is free, or a free one for 0: viser would silently take the next one.

    Raises:
        InvalidInputError: It cannot be listened on.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        try:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
        except (OSError, OverflowError) as e:
            raise InvalidInputError(
                f"port: expected one that is free on {host!r}, got {port} ({getattr(e, 'strerror', None) or e})."
            ) from None
        return int(probe.getsockname()[1])
