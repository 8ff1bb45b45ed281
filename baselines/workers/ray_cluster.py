"""A cluster of Ray, whose address the environment variable RAY_ADDRESS says."""

from __future__ import annotations

import logging
import os
import re
import socket
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, ClassVar

from baselines.workers.pool import Answer, ClusterError, Pool, Report, Result, Unit, answer
from ikgym import parallel
from ikgym.exceptions import MissingDependencyError

try:
    import ray
    from ray import exceptions
except ModuleNotFoundError:
    raise MissingDependencyError('--cluster ray needs ray: pip install "ikgym[cluster]"') from None

#: The environment variable with the address.
VARIABLE = "RAY_ADDRESS"
#: How long is waited for an answer at the address, and then for Ray to connect, in [s].
REACHED, CONNECTED = 5.0, 60.0
#: How a cluster is started, in messages.
START = "Start one by `ray start --head --port 6379`, and on other nodes `ray start --address HOST:6379`."


class RayPool(Pool):
    """The nodes of a cluster, a core for each unit.

    A program that is connected to Ray already stays so.

    Raises:
        ClusterError: No address is known, or nobody answers there.
    """

    losses: ClassVar[tuple[type[BaseException], ...]] = (
        exceptions.WorkerCrashedError,
        exceptions.NodeDiedError,
        exceptions.ObjectLostError,
        exceptions.OutOfMemoryError,
        exceptions.LocalRayletDiedError,
    )

    def __init__(self) -> None:
        self._own = not ray.is_initialized()
        if self._own:
            connect(os.environ.get(VARIABLE, ""))
        # Ray would try again by itself; which units were lost is counted in one place, for all kinds of workers.
        self._remote = ray.remote(num_cpus=1, max_retries=0)(serve)
        self._references: set[Any] = set()

    def submit(self, function: Callable[[Unit, Report], Result], unit: Unit, report: Report) -> Future[Answer[Result]]:
        """See :meth:`Pool.submit`; what the function says on its way is not heard."""
        del report
        reference = self._remote.remote(function, unit)
        self._references.add(reference)
        future: Future[Answer[Result]] = reference.future()
        future.add_done_callback(lambda _: self._references.discard(reference))
        return future

    def close(self) -> None:
        """See :meth:`Pool.close`."""
        for reference in list(self._references):
            ray.cancel(reference, force=True)
        if self._own:
            ray.shutdown()


def serve(function: Callable[[Unit, Report], Result], unit: Unit) -> Answer[Result]:
    """Does a unit, on the one core that it has been given."""
    parallel.limit(1)
    return answer(function, unit, lambda _: None)


def connect(address: str) -> None:
    """Connects to a cluster.

    Args:
        address: As ``RAY_ADDRESS`` has it: HOST:PORT, ray://HOST:PORT, or auto for one on this machine.

    Raises:
        ClusterError: There is no address, or no cluster.
    """
    if not address:
        raise ClusterError(
            f"--cluster ray: expected its address in the environment variable {VARIABLE}, such as 127.0.0.1:6379, or "
            f"auto for one that runs on this machine; it is not set. {START}"
        )
    _reach(address)
    failed: list[BaseException] = []

    def work() -> None:
        try:
            ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
        except BaseException as e:  # in a thread of its own even SystemExit would be lost
            failed.append(e)

    # Where something else answers at the address, Ray goes on trying for minutes.
    thread = threading.Thread(target=work, name="connect to ray", daemon=True)
    thread.start()
    thread.join(CONNECTED)
    if thread.is_alive():
        raise ClusterError(_unreachable(address, f"no answer of Ray within {CONNECTED:g} s"))
    if failed:
        raise ClusterError(_unreachable(address, " ".join(str(failed[0]).split())[:200])) from None


def _reach(address: str) -> None:
    """Insists that somebody listens at an address."""
    found = re.fullmatch(r"(?:ray://)?\[?([^/]+?)\]?:(\d{1,5})", address)
    if found is None:
        if address != "auto":
            raise ClusterError(f"{VARIABLE}: expected HOST:PORT, ray://HOST:PORT or auto, got {address!r}.")
        return
    try:
        socket.create_connection((found[1], int(found[2])), timeout=REACHED).close()
    except (OSError, OverflowError) as e:
        raise ClusterError(_unreachable(address, getattr(e, "strerror", None) or str(e))) from None


def _unreachable(address: str, why: str) -> str:
    return f"No cluster of Ray can be reached at {address} ({why}), which {VARIABLE} says. {START}"
