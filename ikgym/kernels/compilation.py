"""A message to the user while kernels are compiled, which takes a while and seldom happens."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Iterator

from ikgym.kernels import jit

logger = logging.getLogger("ikgym")


@contextlib.contextmanager
def announce(what: str, patience: float = 2.0) -> Iterator[None]:
    """Warns if the block takes long, as when kernels are compiled.

    Args:
        what: Name of the compiled part.
        patience: Time after which the warning is logged, in [s].
    """
    timer = threading.Timer(patience, _warn, [what])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _warn(what: str) -> None:
    if jit.kept_on_disk():
        logger.warning("Compiling %s; this happens once, the machine code is kept on disk.", what)
    else:
        logger.warning(
            "Compiling %s; this happens once in each process, since there is no folder to keep machine code in. "
            "NUMBA_CACHE_DIR can name one.",
            what,
        )
