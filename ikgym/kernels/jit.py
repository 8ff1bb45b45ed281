"""How kernels are compiled: cached on disk, without the interpreter lock, and never stale.

numba looks at the file of a function alone to tell whether what it has on disk is still good. A kernel whose callee in
another file has changed, or a constant from there, would go on running as it was. Here the stamp of a kernel is made
of all that it may reach, and of this file.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from numba import njit
from numba.core.dispatcher import Dispatcher

logger = logging.getLogger("ikgym")

# What reading a file of another version, or a damaged one, raises.
UNREADABLE = (EOFError, pickle.UnpicklingError, ValueError, TypeError, AttributeError, ImportError)

# Stamps of whole modules, by name.
_stamps: dict[str, str] = {}

# Names of kernels for which there is no folder on disk.
_not_kept: set[str] = set()


def kernel(function: Any) -> Any:
    """Compiles a function when it is first called; the machine code is kept on disk.

    Args:
        function: Takes and gives arrays, numbers and tuples of them.
    """
    return _cached(function, _nrt=True)  # else taken over from a caller that is uncounted


def uncounted(function: Any) -> Any:
    """Like :func:`kernel`, without counting references: for inner loops that are handed arrays in named tuples.

    numba counts the references of all arrays of a tuple, atomically, wherever it is passed on or a field is read: for
    paths of 2 knots this took half the time of a Newton step. An uncounted kernel allocates nothing, which numba
    refuses, and returns no array, nor calls what returns one, which the tests look for: its references would be lost.

    Args:
        function: Takes arrays, numbers and tuples of them, and returns numbers.
    """
    return _cached(function, _nrt=False)


def inlined(function: Any) -> Any:
    """Like :func:`kernel`, and copied into its callers, so that constant arguments become constants."""
    return _cached(function, inline="always")


def kept_on_disk() -> bool:
    """Whether there is a folder to keep the machine code of all kernels in, so that it is compiled only once."""
    return not _not_kept


def _cached(function: Any, **options: Any) -> Any:
    try:
        compiled = njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:
        # Neither the folder of the package nor the user's own can be written.
        _not_kept.add(f"{function.__module__}.{function.__qualname__}")
        logger.info("No folder to keep machine code in: %s is compiled anew in each process.", function.__qualname__)
        return njit(nogil=True, **options)(function)
    # Not public, and absent where compilation is switched off: then numba's own stamp has to do.
    cache = getattr(compiled, "_cache", None)
    if cache is not None:
        cache.load_overload = _forgiving(cache.load_overload, cache.flush, function)
        cache.save_overload = _forgiving(cache.save_overload, cache.flush, function)
    file = getattr(cache, "_cache_file", None)
    if hasattr(file, "_source_stamp"):
        file._source_stamp = _stamp(function.__module__) + _stamp_of_globals(function)  # type: ignore[union-attr]
    return compiled


def _forgiving(call: Callable[..., Any], flush: Callable[[], None], function: Any) -> Callable[..., Any]:
    """A call of numba's cache that goes without one where the disk is full or closed, and forgets what it cannot read.

    That may be damaged, or of an older version of the package with types that are gone.
    """

    def tried(*arguments: Any) -> Any:
        try:
            try:
                return call(*arguments)
            except UNREADABLE:
                flush()
                return call(*arguments)
        except (OSError, *UNREADABLE) as e:
            if kept_on_disk():  # said once: what hinders one kernel hinders most
                logger.warning("Machine code cannot be kept on disk, and is compiled anew in each process: %s", e)
            _not_kept.add(f"{function.__module__}.{function.__qualname__}")
            return None

    return tried


def _stamp(module: str) -> str:
    """A digest of a module's file and this one, of its constants so far, and of the modules its kernels come from."""
    if module in _stamps:
        return _stamps[module]
    digest = hashlib.sha256(_source(__name__) + _source(module))
    for name, value in sorted(vars(sys.modules[module]).items()):
        if isinstance(value, (bool, int, float, str)) and not name.startswith("__"):
            digest.update(f"{name}={value!r};".encode())
        elif (origin := _origin(value)) and origin != module:
            _stamps[origin] = _stamp(origin)  # imported, and so complete
            digest.update(_stamps[origin].encode())
    return digest.hexdigest()


def _stamp_of_globals(function: Any) -> str:
    """Stamps of what a function with globals of its own may reach; nothing for others, which their module covers."""
    if function.__globals__ is vars(sys.modules[function.__module__]):
        return ""
    origins = {_origin(value) for value in function.__globals__.values()} - {""}
    return "".join(_stamp(origin) for origin in sorted(origins))


def _origin(value: object) -> str:
    """The name of the module of ours that a kernel comes from, or that has kernels; nothing for all else."""
    if isinstance(value, Dispatcher):
        return str(value.py_func.__module__)
    return value.__name__ if isinstance(value, ModuleType) and _has_kernels(value) else ""


@functools.cache  # kernels are many, and numpy, which all of their modules have, holds hundreds of names
def _has_kernels(module: ModuleType) -> bool:
    return any(isinstance(value, Dispatcher) for value in vars(module).values())


def _source(module: str) -> bytes:
    file = getattr(sys.modules.get(module), "__file__", None)
    return Path(file).read_bytes() if file else b""
