"""Checks of user input: a clear error, or a read-only copy."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError, UnknownNameError

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

# A vector this close to unit length, or a matrix this close to a rotation, is made exact.
UNIT_TOLERANCE = 1e-6

IDENTITY = np.eye(3)

# Lengths, angles, times and speeds of a scenario lie within: far beyond any arm, and no product of them overflows.
SMALLEST, LARGEST = 1e-12, 1e12

GIB = 2**30
# Less than this, in bytes, is not checked.
SMALL = 2**28
# Files of Linux: the memory available to all, and the limit and the use of a control group.
SYSTEM = Path("/proc/meminfo")
GROUP = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current"))


def float_array(
    name: str,
    value: npt.ArrayLike,
    shape: tuple[int | None, ...] | None = None,
    *,
    at_least: float = -math.inf,
    at_most: float = math.inf,
) -> FloatArray:
    """A fresh, C-contiguous float64 copy of finite numbers.

    Args:
        name: Name in messages.
        value: The numbers.
        shape: Its shape, in which None is any length; any shape by default.
        at_least: The least number.
        at_most: The largest absolute value.

    Raises:
        InvalidInputError: It is no such array.
    """
    try:
        raw = np.asarray(value)
        if raw.dtype.kind not in "fiu" or (raw is not value and _has_truth_values(value)):
            raise TypeError
        array = np.array(raw, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name}: expected an array of real numbers, got {shorten(value)}.") from None
    if shape is not None and not _fits(array.shape, shape):
        wanted = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
        raise InvalidInputError(f"{name}: expected shape {wanted}, got {array.shape}.")
    if not np.isfinite(array).all():
        raise InvalidInputError(f"{name}: expected finite numbers, got {shorten(value)}.")
    if at_most < math.inf and (np.abs(array) > at_most).any():
        raise InvalidInputError(f"{name}: expected absolute values of at most {at_most:g}, got {shorten(value)}.")
    if at_least > -math.inf and (array < at_least).any():
        i = int(np.argmax(array.ravel() < at_least))
        raise InvalidInputError(
            f"{name}: expected numbers of at least {at_least:g}, got {array.ravel()[i]:g} as number {i}."
        )
    return array


def _has_truth_values(value: object) -> bool:
    """Whether a list has truth values, which NumPy takes for 0 and 1 among numbers."""
    return isinstance(value, (bool, np.bool_)) or (
        isinstance(value, (tuple, list)) and any(map(_has_truth_values, value))
    )


def frozen_array(
    name: str, value: npt.ArrayLike, shape: tuple[int | None, ...] | None = None, **bounds: Any
) -> FloatArray:
    """Like :func:`float_array`, and read-only."""
    return read_only(float_array(name, value, shape, **bounds))


def ending(name: str, value: npt.ArrayLike, *tail: int, **bounds: Any) -> FloatArray:
    """Like :func:`float_array`, of any shape that ends in the given lengths."""
    array = float_array(name, value, **bounds)
    if array.shape[-len(tail) :] != tail:
        wanted = "(..., " + ", ".join(map(str, tail)) + ")"
        raise InvalidInputError(f"{name}: expected shape {wanted}, got {array.shape}.")
    return array


def read_only(array: FloatArray) -> FloatArray:
    """The same array, with writing to it switched off."""
    array.flags.writeable = False
    return array


def per_joint(name: str, value: npt.ArrayLike, n: int, **bounds: Any) -> FloatArray:
    """One number for all joints, or one a joint, as a read-only array of shape (n,); bounds as in `float_array`."""
    array = frozen_array(name, value, **bounds)
    return frozen_array(name, array, (n,)) if array.ndim else read_only(np.full(n, array))


def as_given(given: npt.ArrayLike, array: FloatArray) -> float | tuple[float, ...]:
    """An array of :func:`per_joint` as plain numbers: one if one was given, else one a joint."""
    return float(array[0]) if np.ndim(given) == 0 else tuple(array.tolist())


def number(
    name: str,
    value: float,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
) -> float:
    """A finite number within its bounds."""
    bound = _range(above, at_least, at_most, below)
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InvalidInputError(f"{name}: expected a finite number{bound}, got {shorten(value)}.")
    try:
        out = float(value)
    except OverflowError:  # a whole number beyond all floats
        out = math.inf
    if (
        not math.isfinite(out)
        or (above is not None and not out > above)
        or (at_least is not None and not out >= at_least)
        or (at_most is not None and not out <= at_most)
        or (below is not None and not out < below)
    ):
        raise InvalidInputError(f"{name}: expected a finite number{bound}, got {out!r}.")
    return out


def whole_number(name: str, value: int, *, at_least: int, at_most: int | None = None) -> int:
    """A whole number within its bounds."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not whole or value < at_least or (at_most is not None and value > at_most):
        bounds = f"of at least {at_least}" if at_most is None else f"from {at_least} to {at_most}"
        raise InvalidInputError(f"{name}: expected a whole number {bounds}, got {shorten(value)}.")
    return int(value)


def check_sizes(name: str, value: object) -> None:
    """Checks that no number is absurdly large or small, in sequences, tables and the fields of dataclasses, too."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            check_sizes(field.name, getattr(value, field.name))
    elif isinstance(value, Mapping):
        for key, one in value.items():
            check_sizes(f"{name}: {key}", one)
    elif isinstance(value, (tuple, list)):
        for one in value:
            check_sizes(name, one)
    elif isinstance(value, (int, float)) and value != 0 and not SMALLEST <= abs(value) <= LARGEST:
        raise InvalidInputError(
            f"{name}: expected 0, or an absolute value from {SMALLEST:g} to {LARGEST:g}, got {shorten(value)}."
        )


def one_a_row(name: str, given: Any, rows: int) -> list[int | None]:
    """Whole numbers of at least 0 for N rows: one for all of them, or one a row; None where there is none."""
    numbers = list(given) if isinstance(given, (tuple, list, np.ndarray)) else [given] * rows
    if len(numbers) != rows:
        raise InvalidInputError(f"{name}: expected {rows} numbers, one a row, got {len(numbers)}.")
    return [None if one is None else whole_number(name, one, at_least=0) for one in numbers]


def flag(name: str, value: bool) -> bool:
    """A truth value."""
    if not isinstance(value, bool):
        raise InvalidInputError(f"{name}: expected true or false, got {value!r}.")
    return value


def rotation_matrix(name: str, value: npt.ArrayLike) -> FloatArray:
    """A rotation matrix, made exactly orthogonal if it is within 1e-6 of one, and read-only."""
    return read_only(rotation_matrices(name, float_array(name, value, (3, 3))))


def rotation_matrices(name: str, value: npt.ArrayLike) -> FloatArray:
    """Rotation matrices, each made exactly orthogonal as :func:`rotation_matrix` does. Fresh, of shape (..., 3, 3)."""
    matrices = ending(name, value, 3, 3, at_most=LARGEST)
    rows = matrices.reshape(-1, 3, 3)
    deviations = np.abs(rows @ rows.transpose(0, 2, 1) - IDENTITY).max(axis=(1, 2))
    wrong = (deviations > UNIT_TOLERANCE) | (np.linalg.det(rows) < 0.0)
    if wrong.any():
        raise InvalidInputError(
            f"{name}: expected a rotation matrix (orthogonal, determinant 1), got {rows[np.argmax(wrong)].tolist()}."
        )
    for row in np.flatnonzero(deviations > 1e-14):
        left, _, right = np.linalg.svd(rows[row])
        rows[row] = left @ right
    return matrices


def direction(name: str, value: npt.ArrayLike) -> FloatArray:
    """A vector of any length above 0, read-only. Shape (3,)."""
    vector = frozen_array(name, value, (3,), at_most=LARGEST)
    if not vector.any():
        raise InvalidInputError(f"{name}: expected a direction, got the zero vector.")
    return vector


def interval(name: str, value: npt.ArrayLike, least: float = -LARGEST, most: float = LARGEST) -> tuple[float, float]:
    """A range (low, high) within bounds."""
    low, high = float_array(name, value, (2,)).tolist()
    if not least <= low <= high <= most:
        within = f" within {least:g} and {most:g}"
        raise InvalidInputError(f"{name}: expected a range (low, high){within}, got ({low:g}, {high:g}).")
    return low, high


@dataclasses.dataclass(frozen=True)
class Bounds:
    """Bounds of a number as the annotation of a field, see :class:`ikgym.frozen.Frozen`; of a whole number for int."""

    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    below: float | None = None

    def check(self, kind: type[Any]) -> functools.partial[Any]:
        """The check of a field of this class, int or float."""
        bounds = {name: bound for name, bound in vars(self).items() if bound is not None}
        return functools.partial(whole_number if kind is int else number, **bounds)

    def __str__(self) -> str:
        return _range(self.above, self.at_least, self.at_most, self.below).strip()


def one_of(names: Iterable[str]) -> functools.partial[str]:
    """The check of a field that is one of these names; for few ones there is :data:`typing.Literal`."""
    return functools.partial(choice, available=names)


def choice(name: str, value: Any, available: Iterable[str]) -> str:
    """One of several names.

    Raises:
        UnknownNameError: It is none of them.
    """
    known_name(f"choice of {name}", value, available)
    return str(value)


#: Fields of frozen dataclasses that name their check: a number of either sign, and one from 1e-12 to 1e12.
Signed = Annotated[float, Bounds(at_least=-LARGEST, at_most=LARGEST)]
Positive = Annotated[float, Bounds(at_least=SMALLEST, at_most=LARGEST)]
Seed = Annotated[int, Bounds(at_least=0)]
Flag = Annotated[bool, flag]
#: Arrays up to 1e12: of shape (n,); of shape (3,); likewise, but not 0; likewise, all of at least 1e-12.
Numbers = Annotated[FloatArray, functools.partial(frozen_array, shape=(None,), at_most=LARGEST)]
Vector = Annotated[FloatArray, functools.partial(frozen_array, shape=(3,), at_most=LARGEST)]
Direction = Annotated[FloatArray, direction]
Sizes = Annotated[FloatArray, functools.partial(frozen_array, shape=(3,), at_least=SMALLEST, at_most=LARGEST)]
#: A rotation matrix, and a range (low, high).
Rotation = Annotated[FloatArray, rotation_matrix]
Interval = Annotated[tuple[float, float], interval]


@contextlib.contextmanager
def about(what: object) -> Iterator[None]:
    """Begins the messages of bad input with their subject, such as a file."""
    try:
        yield
    except InvalidInputError as error:
        raise InvalidInputError(f"{what}: {error}") from None


@contextlib.contextmanager
def add_location(where: str, file: object = None) -> Iterator[None]:
    """Adds the file or the table to the messages of errors."""
    if not where and file is None:
        yield
        return
    before, after = (f"[{where}] ", f" of [{where}]") if file is None else (f"{file}: ", f" in {file}")
    try:
        yield
    except UnknownNameError as error:
        raise UnknownNameError(f"{error.kind}{after}", error.name, error.available) from None
    except InvalidInputError as error:
        raise InvalidInputError(f"{before}{error}") from None


def different_texts(name: str, value: Any, count: int | None = None) -> tuple[str, ...]:
    """A list of different texts, none of them empty, by default of any length."""
    texts = tuple(value) if isinstance(value, (tuple, list)) else ()
    good = {one for one in texts if isinstance(one, str) and one}
    if not isinstance(value, (tuple, list)) or len(good) != len(texts) or count not in (None, len(texts)):
        many = "different texts" if count is None else f"{count} different texts"
        raise InvalidInputError(f"{name}: expected {many}, got {shorten(value)}.")
    return texts


def known_names(kind: str, given: Iterable[str], available: Iterable[str]) -> None:
    """Checks that all names are available."""
    available = tuple(available)
    for name in given:
        known_name(kind, name, available)


def known_name(kind: str, name: object, available: Iterable[str]) -> None:
    """Checks that a name is available; anything but a text is not."""
    available = tuple(available)
    if not isinstance(name, str) or name not in available:
        raise UnknownNameError(kind, name, available)


def _fits(shape: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    return len(shape) == len(wanted) and all(w is None or n == w for n, w in zip(shape, wanted, strict=True))


def _range(above: float | None, at_least: float | None, at_most: float | None, below: float | None) -> str:
    """The allowed numbers, in words."""
    if below is not None:
        return f"{_range(above, at_least, at_most, None)} and below {below:g}"
    if above is not None:
        return f" above {above:g}" + ("" if at_most is None else f" and of at most {at_most:g}")
    if at_least is None:
        return "" if at_most is None else f" of at most {at_most:g}"
    return f" of at least {at_least:g}" if at_most is None else f" from {at_least:g} to {at_most:g}"


def shorten(value: object, limit: int = 120) -> str:
    """A value in one line for messages, truncated if it is long."""
    text = " ".join(repr(value).split())
    return text if len(text) <= limit else text[: limit - 1] + "…"


def check_memory(name: str, needed: int) -> None:
    """Checks that there is memory for a number of bytes; the name begins the message."""
    if needed <= SMALL:
        return
    left = available_memory()
    if left is not None and needed > left:
        raise InvalidInputError(
            f"{name}: expected to fit into memory, but take about {gib(needed)}, and {gib(left)} are available."
        )


def gib(amount: int) -> str:
    """A number of bytes in words."""
    return f"{amount // GIB:,} GiB" if amount >= 100 * GIB else f"{amount / GIB:.1f} GiB"


def available_memory() -> int | None:
    """The memory that this process can still take, in bytes; None where the system does not say."""
    known = []
    with contextlib.suppress(OSError, StopIteration, ValueError):
        lines = SYSTEM.read_text().splitlines()
        known.append(next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:")))
    with contextlib.suppress(OSError, ValueError):  # "max" is no number: no bound
        most, taken = (int(file.read_text()) for file in GROUP)
        known.append(max(most - taken, 0))
    return min(known, default=None)
