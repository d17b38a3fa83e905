"""Dataclasses to plain data (numbers, strings, lists, maps) and back, checked by their declared types.

What comes back has been looked at value by value: nothing missing or unknown, no NaN, no text or list longer
than what any message needs. It is data only; no code, class name or path decides what is made of it.
"""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.renamed import former_names, with_present_names

LONGEST_TEXT = 2000
LONGEST_LIST = 4096
LARGEST = 1e9
"""No quantity in a message is larger, in whatever SI unit."""
SHAPES: Mapping[str, tuple[int, ...]] = {"pose": (7,), "access": (3,), "exit": (3,), "matrix": (3, 3)}
"""Shapes of arrays that are fields of dataclasses, by the field's name."""


def to_plain(value: Any) -> Any:
    """Numbers, strings, lists and maps of these, whatever a dataclass holds; exact for every number.

    Raises:
        InputError: There is something else in it.
    """
    if value is None or isinstance(value, str | bool | int | float):
        return value.item() if isinstance(value, np.generic) else value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: to_plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(k): to_plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [to_plain(v) for v in value]
    raise InputError(f"a {type(value).__name__} cannot be sent to another process: {shown(value)}")


def from_plain(kind: Any, data: Any, where: str = "it") -> Any:
    """A value of a declared type from plain data.

    Args:
        kind: ``str``, ``bool``, ``int``, ``float``, a tuple or mapping of these, a dataclass, or a union of
            one of them with None.
        data: The plain data.
        where: What it is, for the error's sentence.

    Raises:
        InputError: The data is not of this type; says where and what was found.
    """
    if kind is str:
        if not isinstance(data, str) or len(data) > LONGEST_TEXT or not data.isprintable():
            raise _wrong(where, f"printable text of at most {LONGEST_TEXT} characters", data)
        return data
    if kind is bool:
        if not isinstance(data, bool):
            raise _wrong(where, "true or false", data)
        return data
    if kind is int:
        if isinstance(data, bool) or not isinstance(data, int) or not -(1 << 63) <= data < 1 << 64:
            raise _wrong(where, "a whole number within 64 bits", data)
        return data
    if kind is float:
        return _number(data, where)
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        (only,) = (t for t in inner if t is not type(None))
        return None if data is None else from_plain(only, data, where)
    if origin is tuple:
        return _tuple(inner, data, where)
    if origin is dict:
        if not isinstance(data, dict) or len(data) > LONGEST_LIST:
            raise _wrong(where, "a map", data)
        return {from_plain(str, k, where): from_plain(inner[1], v, f"{where} '{k}'") for k, v in data.items()}
    if dataclasses.is_dataclass(kind):
        return _dataclass(kind, data, where)
    raise TypeError(f"{kind} is no type of a message")


def spelled(kind: Any) -> Any:
    """A declared type as plain data: the same where `from_plain` takes the same.

    Args:
        kind: A type that `from_plain` knows.
    """
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        return {
            name: ["array", *SHAPES[name]] if hint is Any else spelled(hint)
            for name, hint in _hints(kind).items()
        }
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return ["optional", *(spelled(t) for t in inner if t is not type(None))]
    if origin is not None:
        return [origin.__name__, *("..." if t is Ellipsis else spelled(t) for t in inner)]
    return kind.__name__


def shown(value: Any) -> str:
    """A value in a sentence: short, and without characters that a terminal would obey."""
    if isinstance(value, str | bytes):
        text = repr(value[:40])
    elif isinstance(value, list | tuple | dict):
        text = f"a {type(value).__name__} of {len(value)}"
    else:
        text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _number(data: Any, where: str) -> float:
    # Comparisons with NaN are false.
    if isinstance(data, bool) or not isinstance(data, int | float) or not -LARGEST <= data <= LARGEST:
        raise _wrong(where, f"a number within +-{LARGEST:.0e}", data)
    return float(data)


def _tuple(inner: tuple[Any, ...], data: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(data, list) or len(data) > LONGEST_LIST:
        raise _wrong(where, f"a list of at most {LONGEST_LIST}", data)
    if len(inner) == 2 and inner[1] is Ellipsis:
        return tuple(from_plain(inner[0], v, f"{where}[{i}]") for i, v in enumerate(data))
    if len(data) != len(inner):
        raise _wrong(where, f"a list of {len(inner)}", data)
    return tuple(from_plain(t, v, f"{where}[{i}]") for i, (t, v) in enumerate(zip(inner, data, strict=True)))


def _dataclass(kind: Any, data: Any, where: str) -> Any:
    hints = _hints(kind)
    if isinstance(data, dict) and (former := former_names(kind)):
        data = with_present_names(data, former)
    if not isinstance(data, dict) or data.keys() != hints.keys():
        known = set(data) if isinstance(data, dict) else set()
        odd = sorted(str(k) for k in known.symmetric_difference(hints))
        raise _wrong(
            where, f"a {kind.__name__}", data, f" (unknown or missing: {shown(odd[0])})" if odd else ""
        )
    return kind(
        **{
            name: _array(data[name], SHAPES[name], f"{where}: {name}")
            if hint is Any
            else from_plain(hint, data[name], f"{where}: {name}")
            for name, hint in hints.items()
        }
    )


def _array(data: Any, shape: tuple[int, ...], where: str) -> Any:
    rows = data if len(shape) == 2 else [data]
    for row in (
        rows if isinstance(rows, list) and len(rows) == (shape[0] if len(shape) == 2 else 1) else [None]
    ):
        if not isinstance(row, list) or len(row) != shape[-1]:
            raise _wrong(where, f"numbers of shape {shape}", data)
        for value in row:
            _number(value, where)
    return np.array(data, np.float64)


@lru_cache(maxsize=64)
def _hints(kind: Any) -> Mapping[str, Any]:
    hints = get_type_hints(kind)
    return {f.name: hints[f.name] for f in dataclasses.fields(kind) if f.init}


def _wrong(where: str, expected: str, data: Any, more: str = "") -> InputError:
    found = "NaN" if isinstance(data, float) and math.isnan(data) else shown(data)
    return InputError(f"{where} should be {expected}, found {found}{more}")
