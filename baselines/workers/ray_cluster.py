"""A cluster of Ray, whose address the environment variable RAY_ADDRESS says."""

from __future__ import annotations

import logging
import os
import re
import socket
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from baselines.workers.pool import Answer, ClusterError, LostError, Pool, Report, Result, Unit, answer
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
#: What Ray raises where a worker or its node has ended.
LOSSES = (
    exceptions.WorkerCrashedError,
    exceptions.NodeDiedError,
    exceptions.ObjectLostError,
    exceptions.OutOfMemoryError,
    exceptions.LocalRayletDiedError,
)


class RayPool(Pool):
    """The nodes of a cluster, a core for each unit.

    A program that is connected to Ray already stays so.

    Raises:
        ClusterError: No address is known, or nobody answers there.
    """

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
        future = Future[Answer[Result]]()

        def settle(done: Future[Answer[Result]]) -> None:
            self._references.discard(reference)
            if (failed := done.exception()) is None:
                future.set_result(done.result())
            else:
                future.set_exception(_translated(failed))

        reference.future().add_done_callback(settle)
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


def check() -> None:
    """Insists that an address is known, and that somebody listens there.

    Raises:
        ClusterError: It is not, or nobody does.
    """
    if not ray.is_initialized():
        _reach(os.environ.get(VARIABLE, ""))


def connect(address: str) -> None:
    """Connects to a cluster.

    Args:
        address: As ``RAY_ADDRESS`` has it: HOST:PORT, or auto for one on this machine.

    Raises:
        ClusterError: There is no address, or no cluster.
    """
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
    if not address:
        raise ClusterError(
            f"--cluster ray: expected its address in the environment variable {VARIABLE}, such as 127.0.0.1:6379, or "
            f"auto for one that runs on this machine; it is not set. {START}"
        )
    if address == "auto":
        return
    if (found := re.fullmatch(r"\[?([^/]+?)\]?:(\d{1,5})", address)) is None:
        raise ClusterError(f"{VARIABLE}: expected HOST:PORT or auto, got {address!r}.")
    try:
        socket.create_connection((found[1], int(found[2])), timeout=REACHED).close()
    except (OSError, OverflowError) as e:
        raise ClusterError(_unreachable(address, getattr(e, "strerror", None) or str(e))) from None


def _translated(failed: BaseException) -> LostError | ClusterError:
    """What Ray raises instead of an answer; of the pages that it may say about it the first line, or the last one."""
    lines = str(failed).strip().splitlines() or [type(failed).__name__]
    if isinstance(failed, LOSSES):
        return LostError(lines[0][:200])
    return ClusterError(
        f"A node of the cluster cannot do its work: {lines[-1][:400]}. Install ikgym, and whatever its policies are "
        "made of, in the same versions on all nodes."
    )


def _unreachable(address: str, why: str) -> str:
    return f"No cluster of Ray can be reached at {address} ({why}), which {VARIABLE} says. {START}"
