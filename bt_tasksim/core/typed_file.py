"""Reading values from data files, with sentences that say which one is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bt_tasksim.errors import InputError, nearest
from bt_tasksim.poses import Array


def check_keys(
    data: Any, where: str, needed: Mapping[str, Any], optional: Mapping[str, Any] | None = None
) -> None:
    """Says which key is missing, or unknown and what it may have been meant to be.

    Args:
        data: What stands in the file.
        where: Path of keys that leads there, with a point at its end; empty for the whole file.
        needed: Keys that must be there, with those inside them (None: anything).
        optional: Keys that may be there, likewise.

    Raises:
        InputError: A key is missing or unknown, or something is no mapping.
    """
    if not isinstance(data, dict):
        raise InputError(f"'{where.rstrip('.')}' should be a mapping, found {data!r}")
    optional = optional or {}
    known = {*needed, *optional}
    for key in data:
        if key not in known:
            raise InputError(f"unknown key '{where}{key}'{nearest(str(key), known)}")
    for key, inner in needed.items():
        if key not in data:
            raise InputError(f"'{where}{key}' is missing")
        if inner is not None:
            check_keys(data[key], f"{where}{key}.", inner, optional.get(key))


def names(values: Any, what: str) -> tuple[str, ...]:
    """A list of names."""
    if not isinstance(values, list) or not values or not all(isinstance(v, str) for v in values):
        raise InputError(f"{what} should be a list of names, found {values!r}")
    return tuple(values)


def number(value: Any, what: str) -> float:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise InputError(f"{what} should be a number, found {value!r}")
    return float(value)


def positive(value: Any, what: str) -> float:
    """A finite number above zero."""
    if number(value, what) <= 0.0:
        raise InputError(f"{what} should be positive, found {value!r}")
    return float(value)


def vector(values: Any, n: int, what: str) -> Array:
    """Finite numbers ``(n,)``, not to be written to."""
    try:
        array = np.array(values, float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (n,) or not np.all(np.isfinite(array)):
        raise InputError(f"{what} should be {n} finite numbers, found {values!r}")
    array.setflags(write=False)
    return array
