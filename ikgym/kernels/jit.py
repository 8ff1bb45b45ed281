"""How kernels are compiled: once each, cached on disk, without the interpreter lock, and never stale.

numba looks at the file of a function alone to tell whether its machine code on disk is good. A kernel whose callee in
another file has changed, or a constant from there, would go on running as it was. Here the stamp of a kernel is made
of all that it may reach, and of this file.

numba also copies a callee into each of its callers, where LLVM optimises it again: a solver of 100 kernels took two
minutes. Here LLVM gets a copy of small kernels alone, which it may inline. Callers of a larger kernel refer to its
machine code by name. The name is the same in all processes, and whoever loads the caller loads the callee first.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import importlib
import inspect
import itertools
import logging
import pickle
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import llvmlite.binding as llvm
import numba
from numba import njit, types
from numba.core.compiler import Compiler
from numba.core.dispatcher import Dispatcher

logger = logging.getLogger("ikgym")

# Errors of reading a file that is damaged or of another version.
UNREADABLE = (EOFError, pickle.UnpicklingError, ValueError, TypeError, AttributeError, ImportError)

# The newest numba that the private parts used here were tested with.
TESTED = (0, 68)

# LLVM inlines hardly any function of more instructions.
INLINED_INSTRUCTIONS = 200

# Stamps of whole modules, by name.
_stamps: dict[str, str] = {}

# Stamps of single kernels.
_stamps_of_kernels: dict[Any, str] = {}

# Names of kernels for which there is no folder on disk.
_not_kept: set[str] = set()


def kernel(function: Any) -> Any:
    """Compiles a function when it is first called; the machine code is kept on disk.

    Args:
        function: Takes and gives arrays, numbers and tuples of them.
    """
    return _cached(function, _nrt=True)  # else taken over from a caller that is uncounted


def inner(function: Any) -> Any:
    """Like :func:`kernel`, to be called by kernels: the wrapper for Python takes as long as the kernel to compile."""
    return _cached(function, _nrt=True, no_cpython_wrapper=True)


def uncounted(function: Any) -> Any:
    """Like :func:`inner`, without counting references: for inner loops that are handed arrays in named tuples.

    numba counts the references of all arrays of a tuple, atomically, wherever it is passed on or a field is read: for
    paths of 2 knots this took half the time of a Newton step. An uncounted kernel allocates nothing, which numba
    refuses, and returns no array nor calls a function that does, as tests check: its references would be lost.

    Args:
        function: Takes arrays, numbers and tuples of them, and returns numbers.
    """
    return _cached(function, _nrt=False, no_cpython_wrapper=True)


def inlined(function: Any) -> Any:
    """Like :func:`uncounted`, and copied into its callers by LLVM, so that constant arguments become constants."""
    return _cached(function, _nrt=False, no_cpython_wrapper=True, forceinline=True)


def expanded(function: Any) -> Any:
    """Like :func:`kernel`, and copied into its callers before they are compiled: the way to return arrays to all.

    Each copy is compiled anew, at ten times the cost of :func:`inlined`.
    """
    return _cached(function, inline="always")


def kept_on_disk() -> bool:
    """Whether there is a folder to keep the machine code of all kernels in, so that it is compiled only once."""
    return not _not_kept


def _known(version: str) -> bool:
    """Whether this module was tested with a version of numba; the log warns of newer ones."""
    known = tuple(map(int, version.split(".")[:2])) <= TESTED
    if not known:
        logger.warning(
            "numba %s is newer than %d.%d, the newest that was tested: kernels are compiled anew in each process. "
            'To keep them on disk: pip install "numba<%d.%d".',
            *(version, *TESTED, TESTED[0], TESTED[1] + 1),
        )
    return known


_numba_known = _known(numba.__version__)


def _cached(function: Any, **options: Any) -> Any:
    if not _numba_known:
        # Its own cache would not notice a change of a callee in another file.
        _not_kept.add(f"{function.__module__}.{function.__qualname__}")
        return njit(nogil=True)(function)
    options |= {"nogil": True, "no_cfunc_wrapper": True, "pipeline_class": _Compiler}
    try:
        compiled = njit(cache=True, **options)(function)
    except RuntimeError:
        # Neither the folder of the package nor the user's own can be written.
        _not_kept.add(f"{function.__module__}.{function.__qualname__}")
        logger.info("No folder to keep machine code in: %s is compiled anew in each process.", function.__qualname__)
        return _linked(njit(**options)(function))
    # Not public, and absent where compilation is switched off: then numba's own stamp has to do.
    cache = getattr(compiled, "_cache", None)
    if cache is not None:
        cache.load_overload = _forgiving(cache.load_overload, cache.flush, function)
        cache.save_overload = _forgiving(cache.save_overload, cache.flush, function)
    file: Any = getattr(cache, "_cache_file", None)
    if hasattr(file, "_source_stamp"):
        file._source_stamp = _stamp(function.__module__) + _stamp_of_globals(function)
        _stamps_of_kernels[function] = file._source_stamp
    return _linked(compiled)


class _Compiler(Compiler):
    """numba's, for kernels of a module with names of machine code that are the same in all processes."""

    def compile_extra(self, func: Any) -> Any:
        collecting = gc.isenabled()
        gc.disable()  # numba keeps nearly all that it makes: looking through it took a seventh of the time
        try:
            return super().compile_extra(func)  # type: ignore[no-untyped-call]
        finally:
            if collecting:
                gc.enable()

    def define_pipelines(self) -> Any:
        function = self.state.func_id.func
        if function in _stamps_of_kernels and _find(function.__module__, function.__qualname__, function):
            self.state.func_id.unique_id = _stamps_of_kernels[function][:16]
            self.state.func_id.unique_name = f"{function.__qualname__}${self.state.func_id.unique_id}"
        return super().define_pipelines()  # type: ignore[no-untyped-call]


@dataclass(frozen=True)
class _Callee:
    """A kernel whose machine code callers refer to by name; a call loads it, before a caller is loaded from disk.

    Attributes:
        module: Where it is.
        name: Its name there.
        arguments: The numba types of its arguments.
        symbol: The name of its machine code.
    """

    module: str
    name: str
    arguments: tuple[Any, ...]
    symbol: str

    def __call__(self) -> None:
        importlib.import_module(self.module)
        if (compiled := _find(self.module, self.name)) is None:
            raise ImportError(f"{self.module} has no kernel {self.name}.")
        compiled.compile(self.arguments)
        if compiled.overloads[self.arguments].fndesc.llvm_func_name != self.symbol:
            raise ImportError(f"{self.module}.{self.name} is another one.")


def _find(module: str, name: str, function: Any = None) -> Any:
    """The kernel of a name, if there is one, and if it is made of that function."""
    found = getattr(sys.modules.get(module), name, None)
    return found if isinstance(found, Dispatcher) and function in {None, found.py_func} else None


def _linked(compiled: Any) -> Any:
    """Hands callers the name of a large kernel instead of a copy; kernels within functions are copied as ever.

    Nothing that is used here of numba's machine code is public.
    """
    if not isinstance(compiled, Dispatcher):  # compilation is switched off
        return compiled
    dispatcher: Any = compiled
    function, engine = compiled.py_func, dispatcher.targetctx.codegen()._engine
    add, template = dispatcher.add_overload, dispatcher.get_call_template
    called_by_python = not compiled.targetoptions.get("no_cpython_wrapper", False)
    if not called_by_python:
        dispatcher._compile_for_args = lambda *arguments: _entry(compiled)._compile_for_args(*arguments)

    def add_overload(result: Any) -> None:
        # Callers need all that a callee needs; numba forgets this for kernels from disk.
        if not compiled.targetoptions.get("_nrt", True) and _has_arrays(result.signature.return_type):
            raise TypeError(f"{function.__qualname__} does not count references, and returns an array.")
        library, symbol = result.library, result.fndesc.llvm_func_name
        library._reload_init.update(result.reload_init or ())
        copied = compiled.targetoptions.get("forceinline", False)
        if not copied and _find(function.__module__, function.__qualname__, function) and _large(library, symbol):
            library._shared_module = llvm.parse_assembly("")
            arguments = tuple(result.fndesc.argtypes)
            library._reload_init.add(_Callee(function.__module__, function.__qualname__, arguments, symbol))
        if called_by_python:
            add(result)
        else:
            compiled.overloads[tuple(result.signature.args)] = result

    def get_call_template(arguments: Any, named: Any) -> Any:
        # numba would compile a kernel once for each constant that it is called with.
        unliteral: Any = types.unliteral
        return template(tuple(map(unliteral, arguments)), {name: unliteral(kind) for name, kind in named.items()})

    dispatcher.add_overload, dispatcher.get_call_template = add_overload, get_call_template
    disk = getattr(getattr(compiled, "_cache", None), "_impl", None)
    if disk is not None:
        rebuild = disk.rebuild

        def rebuilt(context: Any, payload: Any) -> Any:
            # numba looks for names in the copy for callers, which is empty.
            if called_by_python:
                engine._defined_symbols.add(payload[1].llvm_cpython_wrapper_name)
            return rebuild(context, payload)

        disk.rebuild = rebuilt
    return compiled


@functools.cache
def _entry(compiled: Any) -> Any:
    """A kernel that only calls another one, which has no wrapper for calls from Python; kept on disk beside it."""
    function = compiled.py_func
    names = ", ".join(inspect.signature(function).parameters)
    code = compile(f"lambda {names}: kernel({names})", function.__code__.co_filename, "eval")
    entry = eval(code, {"kernel": compiled, "__name__": function.__module__})
    entry.__qualname__ = f"{function.__qualname__}.entry"
    # Kernels within functions may have one name and be different ones.
    return kernel(entry) if _find(function.__module__, function.__qualname__, function) else njit(entry)


def _has_arrays(kind: Any) -> bool:
    parts: Any = kind if isinstance(kind, types.BaseTuple) else ()
    return isinstance(kind, types.Array) or any(_has_arrays(part) for part in parts)


def _large(library: Any, symbol: str) -> bool:
    """Whether a function has too many instructions to be inlined."""
    module = library._shared_module or library._final_module
    found = [f for f in module.functions if f.name == symbol and not f.is_declaration]
    if not found:  # loaded from disk, where callers are handed its name
        return True
    instructions = (1 for block in found[0].blocks for _ in block.instructions)
    return any(True for _ in itertools.islice(instructions, INLINED_INSTRUCTIONS, None))


def _forgiving(call: Callable[..., Any], flush: Callable[[], None], function: Any) -> Callable[..., Any]:
    """A call of numba's cache that does without it where the disk is full or closed, and discards unreadable files.

    They may be damaged, or of an older version of the package with types that are gone.
    """

    def tried(*arguments: Any) -> Any:
        try:
            try:
                return call(*arguments)
            except UNREADABLE:
                flush()
                return call(*arguments)
        except (OSError, *UNREADABLE) as e:
            if kept_on_disk():  # said once: most kernels have the same obstacle
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
    """Stamps of all that a function with globals of its own may reach; none for others, which their module covers."""
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
    if kept_on_disk():
        logger.warning("Compiling %s; this happens once, the machine code is kept on disk.", what)
    else:
        logger.warning(
            "Compiling %s; this happens once in each process, since there is no folder to keep machine code in. "
            "NUMBA_CACHE_DIR can name one.",
            what,
        )
