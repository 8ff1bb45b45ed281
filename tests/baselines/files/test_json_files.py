"""JSON of unknown origin is read, or refused in words."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any

import pytest

from baselines.files import json_files
from baselines.files.json_files import JsonError, made, parse


@dataclasses.dataclass(frozen=True)
class Inner:
    name: str
    share: float | None = None


@dataclasses.dataclass(frozen=True)
class Outer:
    count: int
    cost: float
    runs: tuple[tuple[float, ...], ...] | None
    settings: Mapping[str, Any]
    numbers: dict[str, int]
    inner: Inner | None
    several: tuple[Inner, ...] = ()


GOOD = {"count": 1, "cost": 2, "runs": [[1, 2.5]], "settings": {"a": [1]}, "numbers": {"n": 3}, "inner": {"name": "x"}}


def test_what_is_right_is_read():
    one = made(Outer, parse(json.dumps({**GOOD, "several": [{"name": "y", "share": 1}]}).encode()))
    assert one == Outer(1, 2.0, ((1.0, 2.5),), {"a": [1]}, {"n": 3}, Inner("x"), (Inner("y", 1.0),))
    assert isinstance(one.cost, float)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"\xff", "can't decode"),
        (b"{", "Expecting"),
        (b"[NaN]", "NaN is no JSON"),
        (b"[1e999]", "1e999 is more than a float can hold"),
        (b"[" + b"9" * 400 + b"]", "a number of 400 digits is more than a float can hold"),
        (b'{"a": 1, "b": 2, "a": 3}', "the key 'a' is there twice"),
        (rb'["\ud800"]', "surrogates not allowed"),
        (rb'{"\ud800": 1}', "surrogates not allowed"),
        (b"[" * 60 + b"]" * 60, "nested more than 50 deep"),
        (b"[" * 100_000, "nested more than 50 deep"),
        (b'{"a":' * 100_000, "nested more than 50 deep"),
    ],
)
def test_what_is_no_json_of_ours(text, message):
    with pytest.raises(JsonError, match=message):
        parse(text)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": True}, "the key 'count' should have a value of type int, got True"),
        ({"count": 1.0}, "the key 'count' should have a value of type int"),
        ({"cost": None}, "the key 'cost' should have a value of type float, got None"),
        ({"cost": "1"}, "the key 'cost' should have a value of type float, got '1'"),
        ({"runs": [1.0]}, "the key 'runs' should have a value of type tuple"),
        ({"runs": {"a": 1}}, "the key 'runs' should have a value of type"),
        ({"numbers": {"n": "many"}}, "the key 'numbers' should have a value of type int, got 'many'"),
        ({"inner": {"name": 3}}, "the key 'name' should have a value of type str"),
        ({"inner": {}}, "the key 'name' is missing"),
        ({"inner": "x" * 500}, "got 'x{79} …"),
        ({"more": 1}, "there is a key 'more' that no outer has"),
    ],
)
def test_wrong_types(changes, message):
    with pytest.raises(JsonError, match=message):
        made(Outer, {**GOOD, **changes})


def test_large_files_are_not_read(tmp_path, monkeypatch):
    (tmp_path / "it.json").write_bytes(b"[1, 2, 3]")
    assert json_files.read(tmp_path / "it.json") == [1, 2, 3]
    monkeypatch.setattr(json_files, "MOST", 5)
    with pytest.raises(JsonError, match="too large: expected at most 5 bytes, got 9"):
        json_files.read(tmp_path / "it.json")
