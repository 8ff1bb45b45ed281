"""The viewer as a server: a browser asks, the session changes, the picture follows."""

from __future__ import annotations

import asyncio
import contextlib
import queue
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import viser

from baselines.viewer.approach import Pose
from baselines.viewer.panel import Panel
from baselines.viewer.scene import Scene, Shaper
from baselines.viewer.session import Session
from ikgym.exceptions import InvalidInputError

# Pictures and readings a second.
PICTURES, READINGS = 30.0, 5.0
# Longest wait in [s] for the server to end.
PATIENCE = 5.0


@contextlib.contextmanager
def serving(host: str, port: int) -> Iterator[Any]:
    """A server of viser's, stopped at the end.

    Args:
        host: What it listens on.
        port: The port; 0 for a free one.

    Raises:
        InvalidInputError: It cannot listen there.
    """
    others = set(threading.enumerate())
    server = viser.ViserServer(host, free_port(host, port), label="ikgym view", verbose=False)
    listening = [thread for thread in threading.enumerate() if thread.daemon and thread not in others]
    try:
        yield server
    finally:
        server.stop()
        for thread in listening:  # nobody listens any more when this returns
            thread.join(PATIENCE)
        _close(server.get_event_loop())


def _close(loop: asyncio.AbstractEventLoop) -> None:
    """Closes the loop that viser leaves behind with its tasks, of which Python would complain when it collects them."""
    if not (loop.is_running() or loop.is_closed()):
        loop.run_until_complete(_cancel_others())
        loop.close()


async def _cancel_others() -> None:
    others = asyncio.all_tasks() - {asyncio.current_task()}
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)


class Viewer:
    """A session in the browser.

    Args:
        server: Of viser.
        session: What is shown.
        shaper: Makes the arms, see :class:`Scene`.
    """

    def __init__(self, server: Any, session: Session, shaper: Callable[[Any], Shaper] | None = None) -> None:
        self.session = session
        self._asked: queue.SimpleQueue[Callable[[], object]] = queue.SimpleQueue()
        self._scene = Scene(server, session, shaper and shaper(server))
        self._panel = Panel(server, session, self._asked.put, lambda apart: self._scene.put_apart(apart=apart))
        target = self._scene.target

        def dragged(_: object) -> None:
            pose = Pose.at(target.position, target.wxyz)  # now: the picture may move it before it comes to that
            self._asked.put(lambda: session.aim(pose))

        target.on_update(dragged)
        server.on_client_connect(lambda client: self._scene.look(client.camera))
        self._said = 0.0

    def run(self, stop: threading.Event) -> None:
        """Shows what happens until it is told to stop."""
        before = time.perf_counter()
        while not stop.wait(max(0.0, before + 1.0 / PICTURES - time.perf_counter())):
            now = time.perf_counter()
            self.tick(now - before)
            before = now

    def tick(self, seconds: float) -> None:
        """One picture, after so much time in [s]; what browsers asked for comes first."""
        with contextlib.suppress(queue.Empty):
            while True:
                self._asked.get_nowait()()
        self.session.advance(seconds)
        shown = self.session.shown()
        self._scene.show(shown)
        self._said += seconds
        if self._said >= 1.0 / READINGS:
            self._said = 0.0
            self._panel.show(shown)


def free_port(host: str, port: int) -> int:
    """A port, if nobody listens there; one that is free for 0. viser would take the next one and say nothing.

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
