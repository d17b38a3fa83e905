"""Bundles of arrays with a leading axis of worlds: what a concept remembers, taken apart and put together.

A bundle is an array, or a named tuple, dataclass, tuple, list or mapping of bundles; None and text stand for
themselves.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.transfer import Index


def parts(bundle: Any) -> dict[str, Any] | None:
    """The parts of a bundle, by name; None for an array or anything else that has none."""
    if isinstance(bundle, tuple) and hasattr(bundle, "_asdict"):
        return dict(bundle._asdict())
    kind: Any = type(bundle)
    if not isinstance(bundle, type) and (names := _fields(kind)) is not None:
        return {name: getattr(bundle, name) for name in names}
    if isinstance(bundle, Mapping):
        return {str(k): v for k, v in bundle.items()}
    if isinstance(bundle, tuple | list):
        return {str(k): v for k, v in enumerate(bundle)}
    return None


@lru_cache(maxsize=256)
def _fields(kind: Any) -> tuple[str, ...] | None:
    """Names of what a dataclass is made with; None for other classes."""
    return (
        tuple(f.name for f in dataclasses.fields(kind) if f.init) if dataclasses.is_dataclass(kind) else None
    )


def mapped(function: Callable[..., Any], *bundles: Any) -> Any:
    """A bundle like the first one, whose arrays are made by ``function`` from those of all of them."""
    first = bundles[0]
    if isinstance(first, np.ndarray) or hasattr(first, "dtype"):
        return function(*bundles)
    named = isinstance(first, tuple) and hasattr(first, "_fields")
    if named and all(type(b) is type(first) for b in bundles):
        return type(first)(*(mapped(function, *each) for each in zip(*bundles, strict=True)))
    if first is None or isinstance(first, str):
        return first
    inner = parts(first)
    if inner is None:
        return function(*bundles)
    others = [parts(b) or {} for b in bundles]
    made = {k: mapped(function, *(o[k] for o in others)) for k in inner}
    if isinstance(first, Mapping):
        return dict(zip(first, made.values(), strict=True))
    if isinstance(first, tuple | list) and not hasattr(first, "_asdict"):
        return type(first)(made.values())
    return type(first)(**made)


def taken(bundle: Any, rows: Array | Index) -> Any:
    """The worlds ``rows (k,)`` of a bundle."""
    return mapped(_index(rows).of, bundle)


def merged(whole: Any, rows: Array | Index, new: Any, worlds: int, was: Any = None) -> Any:
    """A bundle of ``worlds`` worlds in which those at ``rows (k,)`` are ``new``; nothing given is changed.

    Args:
        whole: The bundle before; None where there was none: the other worlds are filled with zeros.
        rows: Which worlds.
        new: Of these worlds.
        worlds: How many there are in all.
        was: What was taken of ``whole`` for these worlds, if anything was: arrays of it that are still there
            in ``new`` need not be put back.

    Raises:
        InputError: The worlds do not fit together, since their parts are of unlike kinds, or their arrays of
            unlike types or shapes.
    """
    if whole is not None:
        _check_alike(whole, new)
    index = _index(rows)
    _check_rows(new, len(index))
    if len(index) == worlds:
        return new
    if whole is None:
        return mapped(lambda values: _spread(values, index, worlds), new)
    if was is None:
        return mapped(index.replaced, whole, new)
    return mapped(lambda all_, old, now: all_ if old is now else index.replaced(all_, now), whole, was, new)


def _index(rows: Array | Index) -> Index:
    return rows if isinstance(rows, Index) else Index(rows)


def _check_alike(before: Any, now: Any, name: str = "") -> None:
    """Check that a bundle is made as it was before: an array of other numbers would be cut, a text kept.

    Raises:
        InputError: It is not.
    """
    kind, kept = getattr(now, "dtype", None), getattr(before, "dtype", None)
    if kind is not None and kept is not None and kind == kept:
        if before.shape[1:] != now.shape[1:]:
            raise InputError(
                f"a memory has one shape in all worlds and at all ticks, but {name or 'it'} has "
                f"{_row_shape(before)} at first and {_row_shape(now)} then: pad what is of unlike length"
            )
        return
    inner = None if kind is not None else parts(now)
    old = None if inner is None or kept is not None else parts(before)
    if inner is not None and old is not None and inner.keys() == old.keys():
        for part, value in inner.items():
            _check_alike(old[part], value, f"{name}.{part}" if name else part)
    elif inner is not None or kind is not None or kept is not None or before != now:
        raise InputError(
            f"a memory is of one kind in all worlds and at all ticks, but {name or 'it'} is {_kind(before)} "
            f"at first and {_kind(now)} then: make it the same in begin and in advance"
        )


def _check_rows(new: Any, worlds: int, name: str = "") -> None:
    """Check that a bundle is made of arrays that have a row for each world.

    Raises:
        InputError: It is not.
    """
    if hasattr(new, "dtype"):
        if not new.shape or new.shape[0] != worlds:
            count = f"{worlds} world{'s' if worlds > 1 else ''}"
            raise InputError(
                f"a memory's arrays have a row for each world, but {name or 'it'} has the shape "
                f"{tuple(new.shape)} for {count}"
            )
        return
    inner = parts(new)
    if inner is None and new is not None and not isinstance(new, str):
        raise InputError(
            f"a memory is an array with a row for each world, or a NamedTuple of such, but {name or 'it'} is "
            f"{new!r}"
        )
    for part, value in (inner or {}).items():
        _check_rows(value, worlds, f"{name}.{part}" if name else part)


def _row_shape(values: Array) -> str:
    return str(("N", *values.shape[1:])).replace("'N'", "N")


def _kind(value: Any) -> str:
    if hasattr(value, "dtype"):
        return f"an array of {value.dtype}"
    inner = parts(value)
    return repr(value) if inner is None else f"a {type(value).__name__} of {', '.join(inner) or 'nothing'}"


def _spread(values: Array, index: Index, worlds: int) -> Array:
    xp = array_namespace(values)
    out = xp.zeros((worlds, *values.shape[1:]), dtype=values.dtype, device=values.device)
    index.put(out, values)
    return out


class Rows:
    """Some rows of a bundle's arrays, each taken when it is first looked at.

    Args:
        bundle: Something with arrays as attributes.
        change: What is done to each, such as taking rows.
    """

    def __init__(self, bundle: Any, change: Callable[[Array], Array]) -> None:
        self._bundle, self._change = bundle, change

    def __getattr__(self, name: str) -> Array:
        if name.startswith("__"):
            raise AttributeError(name)
        found = self._change(getattr(self._bundle, name))
        self.__dict__[name] = found
        return found
