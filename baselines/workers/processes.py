"""Processes of this machine, by the standard library."""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any

from baselines.workers.lifetime import end_with_parent
from baselines.workers.pool import Answer, LostError, Pool, Report, Result, Unit, answer


class Processes(Pool):
    """A thread for each process, which it starts, feeds, and replaces when it has died.

    Unlike the standard library's executor it knows which unit a process was at, and loses no other one.

    Args:
        number: Processes at a time; a process is started when there is a unit for it.
    """

    def __init__(self, number: int) -> None:
        # Spawned, not forked: a fork would inherit numba's and the BLAS's threads without their locks' owners.
        self._context = multiprocessing.get_context("spawn")
        self._threads = ThreadPoolExecutor(number, thread_name_prefix="worker")
        self._own = threading.local()
        self._lock = threading.Lock()
        self._alive: set[SpawnProcess] = set()
        self._closed = False

    def submit(self, function: Callable[[Unit, Report], Result], unit: Unit, report: Report) -> Future[Answer[Result]]:
        """See :meth:`Pool.submit`."""
        return self._threads.submit(self._ask, function, unit, report)

    def close(self) -> None:
        """See :meth:`Pool.close`."""
        with self._lock:
            self._closed = True
            processes = list(self._alive)
        for process in processes:
            process.terminate()
        self._threads.shutdown(cancel_futures=True)
        for process in processes:
            process.join()

    def _ask(self, function: Callable[[Unit, Report], Result], unit: Unit, report: Report) -> Answer[Result]:
        """Has the process of this thread do a unit."""
        process, pipe = self._process()
        try:
            pipe.send((function, unit))
            while not isinstance(message := pipe.recv(), Answer):
                report(message)
        except (EOFError, OSError):
            process.join()
            with self._lock:
                self._alive.discard(process)
            self._own.__dict__.clear()
            raise LostError(f"its process has died ({_ending(process.exitcode)})") from None
        return message

    def _process(self) -> tuple[SpawnProcess, Connection]:
        """The process of this thread."""
        if not hasattr(self._own, "process"):
            with self._lock:
                if self._closed:
                    raise LostError("its process was ended")
                here, there = self._context.Pipe()
                process = self._context.Process(target=serve, args=(there,))
                process.start()
                there.close()
                self._alive.add(process)
            self._own.process = process, here
        found: tuple[SpawnProcess, Connection] = self._own.process
        return found


def serve(pipe: Connection) -> None:
    """The life of a process: units come, answers go, until nobody asks any more."""
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a traceback
    while True:
        try:
            function, unit = pipe.recv()
        except EOFError:
            return
        except Exception as e:  # what was sent cannot be imported here
            pipe.send(Answer(None, e))
            continue
        _send(pipe, answer(function, unit, pipe.send))


def _send(pipe: Connection, message: Answer[Any]) -> None:
    """Sends an answer; one that cannot be pickled says so."""
    try:
        pipe.send(message)
    except (EOFError, OSError):
        raise
    except Exception as e:  # pickling runs code of somebody else
        pipe.send(Answer(None, RuntimeError(f"{message.error or message.result!r} cannot be sent: {e}")))


def _ending(code: int | None) -> str:
    return f"signal {signal.Signals(-code).name}" if code is not None and code < 0 else f"exit code {code}"
