"""JSON of unknown origin: read whole, within bounds, and made into dataclasses with every type checked."""

from __future__ import annotations

import collections.abc
import contextlib
import dataclasses
import functools
import json
import math
import pathlib
import types
import typing
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar, Union

from baselines.files import ResultsError, read_bytes
from ikgym.exceptions import IkgymError

#: Bytes of a file that are read at most; results of a hundred thousand episodes have fewer.
MOST = 2**28
#: Objects and lists within each other at most; none of our files has ten.
DEEPEST = 50
# Letters of a value in a message.
SHOWN = 80

T = TypeVar("T")


class JsonError(ValueError):
    """A text is no JSON, or holds what no file of ours does."""


def read(file: pathlib.Path) -> Any:
    """The content of a file.

    Raises:
        OSError: It cannot be read.
        JsonError: It is too large, or no JSON; see :func:`parse`.
    """
    try:
        return parse(read_bytes(file, MOST))
    except OSError:
        raise
    except ValueError as e:  # too large, or a path that is none
        raise e if isinstance(e, JsonError) else JsonError(str(e)) from None


def parse(text: bytes, *, finite: bool = True) -> Any:
    """The value of a text in UTF-8.

    Args:
        text: The text.
        finite: Whether NaN and Infinity are refused, which Python writes and JSON does not know.

    Raises:
        JsonError: It is no JSON, has a key twice, a number that no float can hold, text that no file can hold, or is
            nested too deeply.
    """
    try:
        value = json.loads(
            text.decode(),
            parse_constant=_refuse if finite else None,
            parse_int=_whole,
            parse_float=_float,
            object_pairs_hook=_object,
        )
        _check(value)
    except JsonError:
        raise
    except RecursionError:
        raise JsonError(f"it is nested more than {DEEPEST} deep") from None
    except ValueError as e:
        raise JsonError(str(e)) from None
    return value


def made(kind: type[T], values: object) -> T:
    """A dataclass of a JSON object.

    Args:
        kind: Its class. Fields may be bool, int, float, str, None, Any, dict, Mapping, tuples of them, other
            dataclasses, and unions of these.
        values: An object with a key for each field.

    Raises:
        JsonError: It is no object, a key is missing or is one too many, or a value has another type.
    """
    if not isinstance(values, dict):
        raise JsonError(f"expected an object with the keys of a {kind.__name__.lower()}, got {type(values).__name__}")
    hints: dict[str, tuple[Any, bool]] = _hints(kind)  # type: ignore[arg-type]  # classes are hashable
    if missing := [name for name, (_, needed) in hints.items() if needed and name not in values]:
        raise JsonError(f"the key {missing[0]!r} is missing")
    if unknown := [name for name in values if name not in hints]:
        raise JsonError(f"there is a key {unknown[0]!r} that no {kind.__name__.lower()} has")
    return kind(**{name: _typed(name, hints[name][0], value) for name, value in values.items()})


@contextlib.contextmanager
def reading(what: str, file: pathlib.Path, advice: str = "") -> Iterator[None]:
    """Turns what goes wrong while a file is read into one message.

    Args:
        what: The file's content, in words.
        file: The file.
        advice: A sentence that ends the message.

    Raises:
        ResultsError: The file cannot be read, or what is in it is refused.
    """
    try:
        yield
    except ResultsError:
        raise
    except (OSError, ValueError, IkgymError) as e:
        reason = str(e).removesuffix(".")
        raise ResultsError(f"Cannot read {what} from {file}: {reason}. {advice}".rstrip()) from None


def shown(value: object) -> str:
    """A value in a message, cut short."""
    text = repr(value)
    return text if len(text) <= SHOWN else text[:SHOWN] + " …"


@functools.cache
def _hints(kind: type[Any]) -> dict[str, tuple[Any, bool]]:
    """The type of each field, and whether it must be given."""
    types_by_name = typing.get_type_hints(kind)
    missing = dataclasses.MISSING
    return {
        f.name: (types_by_name[f.name], f.default is missing and f.default_factory is missing)
        for f in dataclasses.fields(kind)
    }


def _typed(name: str, kind: Any, value: Any) -> Any:
    for candidate in typing.get_args(kind) if typing.get_origin(kind) in (Union, types.UnionType) else (kind,):
        fits, out = _fitted(name, candidate, value)
        if fits:
            return out
    expected = str(getattr(kind, "__name__", kind)).replace("typing.", "")
    raise JsonError(f"the key {name!r} should have a value of type {expected}, got {shown(value)}")


def _fitted(name: str, kind: Any, value: Any) -> tuple[bool, Any]:
    """Whether a value is of a type that is no union, and the value as it has it."""
    origin = typing.get_origin(kind) or kind
    if kind is Any:
        return True, value
    if kind in (None, type(None)):
        return value is None, None
    if kind is float:
        whole = isinstance(value, int) and not isinstance(value, bool)
        return whole or isinstance(value, float), float(value) if whole else value
    if dataclasses.is_dataclass(kind):
        return isinstance(value, dict), made(typing.cast("type[Any]", kind), value) if isinstance(value, dict) else None
    if origin is tuple:
        inner = typing.get_args(kind)[0]
        each = value if isinstance(value, list) else []
        return isinstance(value, list), tuple(_typed(name, inner, item) for item in each)
    if origin in (dict, collections.abc.Mapping):
        inner = (*typing.get_args(kind), Any, Any)[1]
        pairs = value.items() if isinstance(value, dict) else ()
        for _, item in pairs:
            _typed(name, inner, item)
        return isinstance(value, dict), value
    return type(value) is origin, value


def _refuse(constant: str) -> None:
    raise JsonError(f"{constant} is no JSON")


def _whole(digits: str) -> int:
    if len(digits) > 300:
        raise JsonError(f"a number of {len(digits)} digits is more than a float can hold")
    return int(digits)


def _float(text: str) -> float:
    if not math.isfinite(value := float(text)):
        raise JsonError(f"{text[:SHOWN]} is more than a float can hold")
    return value


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    out = dict(pairs)
    if len(out) < len(pairs):
        names = [name for name, _ in pairs]
        raise JsonError(f"the key {next(name for name in names if names.count(name) > 1)!r} is there twice")
    return out


def _check(value: Any) -> None:
    """Refuses what is nested too deeply, and text that no file can hold."""
    level: list[Any] = [value]
    for _ in range(DEEPEST):
        for text in level:
            if isinstance(text, str):
                text.encode()  # half of a surrogate pair raises UnicodeEncodeError, which is a ValueError
        objects = [item for item in level if isinstance(item, Mapping)]
        level = [inner for item in level if isinstance(item, (dict, list)) for inner in item]
        level += [inner for item in objects for inner in item.values()]
        if not level:
            return
    raise JsonError(f"it is nested more than {DEEPEST} deep")
