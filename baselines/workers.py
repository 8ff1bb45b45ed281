"""Work in other processes: processes of this machine, or tasks on a cluster of Ray."""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import multiprocessing
import os
import re
import signal
import socket
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from ikgym.exceptions import IkgymError, MissingDependencyError
from ikgym.kernels import threads
from ikgym.validation import known_name, whole_number

logger = logging.getLogger("ikgym")

#: Kinds of clusters.
CLUSTERS = ("ray",)
#: Attempts at a unit of work: a node may be shut down, but a unit that needs too much memory always fails.
TRIES = 3
#: Relative difference that is allowed between costs on different kinds of processors. On processors of one kind they
#: are identical, bit for bit.
TOLERANCE = 1e-6
#: Most processes of this machine, and most tasks of a cluster at the same time.
MOST = 1000
#: The environment variable with the address of the cluster.
ADDRESS = "RAY_ADDRESS"
#: How a cluster is started, for messages.
START = "Start one with `ray start --head --port 6379`, and add nodes with `ray start --address HOST:6379`."

Unit = TypeVar("Unit")
Result = TypeVar("Result")
#: Runs a function of one unit in another process and waits for its result.
Call = Callable[[Callable[[Any], Any], Any], Any]


class LostError(IkgymError):
    """A worker died before its unit of work was done."""


class WorkerError(IkgymError):
    """Workers died repeatedly over one unit of work, or their results differ from those of this machine."""


class ClusterError(IkgymError):
    """A cluster cannot be reached, or one of its nodes cannot do the work."""


@dataclasses.dataclass(frozen=True)
class Workers:
    """The workers.

    Args:
        number: Processes of this machine.
        cluster: The kind of cluster, one of :data:`CLUSTERS`; it takes precedence over the number.

    Raises:
        InvalidInputError: The number is not a whole number from 1 to :data:`MOST`.
        UnknownNameError: There is no such kind of cluster.
    """

    number: int = 1
    cluster: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "number", whole_number("workers", self.number, at_least=1, at_most=MOST))
        if self.cluster is not None:
            known_name("cluster", self.cluster, CLUSTERS)

    @property
    def here(self) -> bool:
        """Whether no other process is needed."""
        return self.cluster is None and self.number == 1

    def check(self) -> None:
        """Connects to the cluster, if there is one, see :func:`connect`; called before any file is written."""
        if self.cluster is not None:
            connect()


#: One process.
ALONE = Workers()


def run_units(
    function: Callable[[Unit], Result], units: Sequence[Unit], workers: Workers, *, tries: int = TRIES
) -> Generator[tuple[Unit, Future[Result]], None, None]:
    """Does units of work in other processes, and yields each as soon as it is done.

    If a worker dies, its unit is retried. All workers end when the generator is closed, see :func:`contextlib.closing`,
    and with this process.

    Args:
        function: Does one unit; a function at the top level of a module that workers can import.
        units: The units of work. They can be pickled.
        workers: The workers.
        tries: Attempts at a unit.

    Yields:
        A unit, and the future of its result. The future raises the function's exception, or :class:`WorkerError` if
        workers died over the unit `tries` times.

    Raises:
        MissingDependencyError: Ray is not installed.
        ClusterError: The cluster cannot be reached.
    """
    started, number = (_processes, workers.number) if workers.cluster is None else (_tasks, MOST)
    with started() as call, contextlib.ExitStack() as stack:
        threads = ThreadPoolExecutor(max(1, min(number, len(units))), thread_name_prefix="worker")
        stack.callback(threads.shutdown, wait=False, cancel_futures=True)
        pending = {threads.submit(_retry, call, function, unit, tries): unit for unit in units}
        for future in as_completed(pending):
            yield pending.pop(future), future


def _retry(call: Call, function: Callable[[Unit], Result], unit: Unit, tries: int) -> Result:
    attempt = 1
    while True:
        try:
            return call(function, unit)  # type: ignore[no-any-return]  # of a pickled function
        except LostError as e:
            if attempt == tries:
                raise WorkerError(f"workers died over it {tries} times, the last time because {e}.") from None
            logger.warning("A worker died (%s); its job is retried.", e)
        attempt += 1


@contextlib.contextmanager
def _processes() -> Iterator[Call]:
    """Processes of this machine, one for each thread that calls, so that a dead one affects one unit only."""
    # Spawned, not forked: a fork would inherit numba's and the BLAS's threads without the owners of their locks.
    context = multiprocessing.get_context("spawn")
    reader, writer = context.Pipe(duplex=False)  # closed, by whatever ends this process, it ends the workers
    local, pools = threading.local(), list[ProcessPoolExecutor]()

    def call(function: Callable[[Any], Any], unit: Any) -> Any:
        if not hasattr(local, "pool"):
            local.pool = ProcessPoolExecutor(1, context, _end_with, (reader,))
            pools.append(local.pool)
        try:
            return local.pool.submit(function, unit).result()
        except BrokenProcessPool:
            del local.pool
            if writer.closed:
                raise
            raise LostError("its process died") from None

    try:
        yield call
    finally:
        writer.close()
        for pool in pools:
            pool.shutdown()
        reader.close()


def _end_with(pipe: Connection) -> None:
    """Ends this worker as soon as the other end of the pipe is closed, at the latest when its parent is killed."""

    def wait() -> None:
        with contextlib.suppress(EOFError, OSError):
            pipe.recv_bytes()
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent, which closes the pipe
    threading.Thread(target=wait, name="end with parent", daemon=True).start()


@contextlib.contextmanager
def _tasks() -> Iterator[Call]:
    """Tasks on the cluster, each with one core."""
    ray = connect()
    kinds = ("WorkerCrashedError", "NodeDiedError", "ObjectLostError", "OutOfMemoryError", "LocalRayletDiedError")
    lost = tuple(getattr(ray.exceptions, kind) for kind in kinds)
    remote = ray.remote(num_cpus=1, max_retries=0)(_on_one_core)
    running = set[Any]()

    def call(function: Callable[[Any], Any], unit: Any) -> Any:
        reference = remote.remote(function, unit)
        running.add(reference)
        try:
            result, error = ray.get(reference)
        except lost as e:
            raise LostError(str(e).strip().partition("\n")[0][:200]) from None
        except ray.exceptions.RayError as e:
            reason = str(e).strip().splitlines()[-1][:400]
            raise ClusterError(
                f"A node of the cluster cannot do its work: {reason}. Install ikgym and the packages of its policies "
                "in the same versions on all nodes."
            ) from None
        finally:
            running.discard(reference)
        if error is not None:
            raise error
        return result

    try:
        yield call
    finally:
        for reference in list(running):
            ray.cancel(reference, force=True)


def _on_one_core(function: Callable[[Any], Any], unit: Any) -> tuple[Any, Exception | None]:
    """Result and error of a unit: Ray would replace the exception."""
    threads.limit_cores(1)
    try:
        return function(unit), None
    except Exception as e:
        return None, e


def connect() -> Any:
    """The module `ray`, connected to the cluster at the address in the environment.

    Raises:
        MissingDependencyError: Ray is not installed.
        ClusterError: The address is missing, or no cluster answers there.
    """
    try:
        import ray
    except ModuleNotFoundError:
        raise MissingDependencyError('--cluster ray needs ray: pip install "ikgym[cluster]"') from None
    if ray.is_initialized():
        return ray
    address = os.environ.get(ADDRESS, "")
    if not address:
        raise ClusterError(
            f"--cluster ray: expected the address of the cluster in the environment variable {ADDRESS}, such as "
            f"127.0.0.1:6379, or auto for a cluster on this machine; it is not set. {START}"
        )
    try:
        if address != "auto":  # Ray itself waits for minutes if no cluster listens
            _listening(address)
        ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
    except (OSError, OverflowError, RuntimeError, ValueError) as e:
        reason = getattr(e, "strerror", None) or " ".join(str(e).split())[:200]
        raise ClusterError(f"No cluster of Ray can be reached at {ADDRESS}={address} ({reason}). {START}") from None
    return ray


def _listening(address: str) -> None:
    if (found := re.fullmatch(r"\[?([^/]+?)\]?:(\d{1,5})", address)) is None:
        raise ClusterError(f"{ADDRESS}: expected HOST:PORT or auto, got {address!r}.")
    socket.create_connection((found[1], int(found[2])), timeout=5.0).close()
