"""The XML of a URDF file: its elements, attributes and numbers, each checked when it is read."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from ikgym.exceptions import InvalidInputError, UnknownNameError

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


def parse(data: bytes) -> Element:
    """The root of an XML document; prefixes of names are letters like all others, declared or not."""
    parser, tree = expat.ParserCreate(), TreeBuilder()
    # Entities are declared in a DOCTYPE only: without one there are none that could be expanded.
    parser.StartDoctypeDeclHandler = _refuse_doctype
    parser.StartElementHandler, parser.EndElementHandler = tree.start, tree.end
    try:
        parser.Parse(data, True)
        return tree.close()
    except InvalidInputError:
        raise
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise InvalidInputError(f"expected XML, got {len(data)} bytes with a fault: {error}.") from error


def _refuse_doctype(*_: object) -> None:
    raise InvalidInputError("expected no DOCTYPE: a URDF needs none, and its entities could grow without bound.")


def index_by_name(robot: Element, tag: str) -> dict[str, Element]:
    """The elements of a tag by their names, which must differ; at least one."""
    found: dict[str, Element] = {}
    for element in robot.iterfind(tag):
        name = attribute("robot", element, "name")
        if name in found:
            raise InvalidInputError(f"expected every {tag} to have a different name, got two called {name!r}.")
        found[name] = element
    if not found:
        raise InvalidInputError(f"expected at least one <{tag}> in <robot>, got none.")
    return found


def label(joint: Element) -> str:
    """A joint in messages."""
    return f"joint {joint.get('name')!r}"


def find_required(where: str, element: Element, tag: str) -> Element:
    """The one element of a tag within another one."""
    found = find_optional(where, element, tag)
    if found is None:
        raise InvalidInputError(f"{where}: expected a <{tag}>, got none.")
    return found


def find_optional(where: str, element: Element, tag: str) -> Element | None:
    """Likewise; None where there is none."""
    found = element.findall(tag)
    if len(found) > 1:
        raise InvalidInputError(f"{where}: expected one <{tag}>, got {len(found)}.")
    return found[0] if found else None


def attribute(where: str, element: Element, key: str, choices: Collection[str] | None = None) -> str:
    """A text that must be there, one of the choices if there are any."""
    value = element.get(key)
    if not value:
        raise InvalidInputError(f'{where}: expected <{element.tag} {key}="…">, got none.')
    if choices is not None and value not in choices:
        raise InvalidInputError(
            f"{where}: expected {key} of <{element.tag}> to be one of {listing(choices)}; got {value!r}."
        )
    return value


def known_attributes(where: str, element: Element, names: Collection[str]) -> None:
    """Refuses unknown attributes, which would count as absent; a prefix marks those of a vendor."""
    for name in element.attrib:
        if name not in names and ":" not in name:
            raise InvalidInputError(f"{where}: {UnknownNameError(f'attribute of <{element.tag}>', name, names)}")


def known_elements(where: str, element: Element, names: Collection[str]) -> None:
    """Refuses elements whose names are nearly known, such as <Origin> or <limits>; others are a vendor's."""
    for tag in (child.tag for child in element if child.tag not in names):
        if difflib.get_close_matches(tag.lower(), names, cutoff=0.8):
            raise InvalidInputError(f"{where}: {UnknownNameError(f'element of <{element.tag}>', tag, names)}")


def numbers(where: str, element: Element | None, key: str, count: int) -> tuple[float, ...]:
    """Finite numbers, zeros where there are none: the default that URDF has for most."""
    text = None if element is None else element.get(key)
    if text is None:
        return (0.0,) * count
    words = text.split()
    if len(words) != count or not all(map(_NUMBER.fullmatch, words)) or not all(map(math.isfinite, map(float, words))):
        many = "a finite number" if count == 1 else f"{count} finite numbers"
        raise InvalidInputError(f"{where}: expected {key} to be {many}, got {text!r}.")
    return tuple(map(float, words))


def listing(names: Collection[str], most: int = 20) -> str:
    """Names in messages."""
    shown = list(names)
    more = f" and {len(shown) - most} more" if len(shown) > most else ""
    return ", ".join(map(repr, shown[:most])) + more or "none"
