"""What all workers have in common: units go in, answers come out, and what was lost is done again."""

from __future__ import annotations

import abc
import logging
import queue
import traceback
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from types import TracebackType
from typing import Any, Generic, NamedTuple, Self, TypeVar

from ikgym.exceptions import IkgymError

logger = logging.getLogger("ikgym")

#: How often a unit is tried before it counts as lost: a node may end, a unit that takes too much memory always will.
TRIES = 3

#: How far costs from another kind of processor may be from those of this one, relative to them. On processors of one
#: kind they are the same, bit for bit.
TOLERANCE = 1e-6

Unit = TypeVar("Unit")
Result = TypeVar("Result")
#: Called by a function with what it wants to say on its way. Workers of a cluster say nothing before they are done.
Report = Callable[[Any], None]


class LostError(IkgymError):
    """A worker has ended before its unit was done; the message says how."""


class WorkerError(IkgymError):
    """Workers have died over a unit again and again, or did something else than this machine would."""


class ClusterError(IkgymError):
    """A cluster cannot be reached, or a node of it cannot do the work."""


class Answer(NamedTuple, Generic[Result]):
    """What came of a unit in another process.

    Attributes:
        result: What the function gave.
        error: What it raised instead.
    """

    result: Result | None
    error: Exception | None = None

    def unwrap(self) -> Any:
        """The result.

        Raises:
            Exception: The one that the function raised.
        """
        if self.error is not None:
            raise self.error
        return self.result


def answer(function: Callable[[Unit, Report], Result], unit: Unit, report: Report) -> Answer[Result]:
    """Does a unit; to be called in the process of a worker.

    Args:
        function: What is done; a name at the top of its module.
        unit: What it is done to.
        report: Takes what it says on its way.
    """
    try:
        return Answer(function(unit, report))
    except Exception as e:
        # The traceback does not survive the way home; a note does.
        e.add_note(f"In a worker:\n{traceback.format_exc()}")
        return Answer(None, e)


class Pool(abc.ABC):
    """Processes elsewhere that do units of work. Leaving the context ends them, whatever they are at."""

    @abc.abstractmethod
    def submit(self, function: Callable[[Unit, Report], Result], unit: Unit, report: Report) -> Future[Answer[Result]]:
        """Hands a unit to the next worker that is free.

        Args:
            function: What is done; a name at the top of its module, which workers can import.
            unit: What it is done to; can be pickled.
            report: Takes what the function says on its way, in any thread.

        Returns:
            The answer; raises :class:`LostError` if its worker has ended.
        """

    @abc.abstractmethod
    def close(self) -> None:
        """Ends all workers."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, e: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def finished(
    pool: Pool,
    function: Callable[[Unit, Report], Result],
    units: Iterable[Unit],
    *,
    tries: int = TRIES,
    again: Callable[[Unit], Unit] = lambda unit: unit,
    report: Callable[[Unit, Any], None] = lambda unit, said: None,
) -> Iterator[tuple[Unit, Result | LostError]]:
    """Does units, and hands each out as soon as it is done.

    A unit whose worker has ended is handed to another one; the others are not touched by it.

    Args:
        pool: Who does them.
        function: See :meth:`Pool.submit`.
        units: What it is done to.
        tries: How often a unit is tried.
        again: From a unit whose worker was lost to what is tried next.
        report: Called in this thread with a unit and what its function says on its way.

    Yields:
        Each unit with its result, or with how its worker ended the last time.

    Raises:
        ClusterError: A node cannot do the work.
        Exception: What the function raised.
    """
    news: queue.SimpleQueue[tuple[Unit, Any] | Future[Answer[Result]]] = queue.SimpleQueue()
    running: dict[Future[Answer[Result]], tuple[Unit, int]] = {}

    def start(unit: Unit, number: int) -> None:
        future = pool.submit(function, unit, lambda said: news.put((unit, said)))
        running[future] = unit, number
        future.add_done_callback(news.put)

    for unit in units:
        start(unit, 1)
    while running:
        item = news.get()
        if isinstance(item, tuple):
            report(*item)
            continue
        unit, number = running.pop(item)
        lost = item.exception()
        if lost is None:
            yield unit, item.result().unwrap()
        elif not isinstance(lost, LostError):
            raise lost
        elif number < tries:
            logger.warning("A worker was lost (%s); its unit is done again.", lost)
            start(again(unit), number + 1)
        else:
            yield unit, lost
