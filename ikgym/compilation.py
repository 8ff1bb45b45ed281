"""A word to the user while kernels are compiled, which happens once and takes a while."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Iterator

logger = logging.getLogger("ikgym")


@contextlib.contextmanager
def announced(what: str, patience: float = 2.0) -> Iterator[None]:
    """Says so if what is inside takes long.

    Args:
        what: What is being compiled.
        patience: Time after which the user is told, in [s].
    """
    timer = threading.Timer(
        patience, logger.warning, [f"Compiling {what}; this happens once, the result is cached on disk."]
    )
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
