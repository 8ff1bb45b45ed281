"""Worker processes that end with the process that has started them, however that ends."""

from __future__ import annotations

import multiprocessing
import os
import threading

#: The exit code of a worker whose parent is gone.
ORPHANED = 1


def end_with_parent() -> None:
    """Ends this process as soon as its parent has ended, be it by SIGKILL. To be called first in a worker.

    A thread waits for the pipe that `multiprocessing` keeps open to a spawned process. It needs no signals, so that it
    works on all systems and in the midst of a kernel.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(ORPHANED)  # nobody is left who could read a result, or an exit code

    threading.Thread(target=wait, name="end-with-parent", daemon=True).start()
