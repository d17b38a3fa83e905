"""Bundles of arrays, compared: what a concept is shown, remembers and answers."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from bt_tasksim.core.bundles import mapped, parts
from bt_tasksim.core.poses import Array, host

TOLERANCE = 1e-6
"""Difference of two numbers, in double precision, up to which they count as the same."""


def joined(bundles: Sequence[Any]) -> Any:
    """One bundle of all worlds of several, in their order; what is no array is that of the first one."""
    return mapped(
        lambda *arrays: np.concatenate(arrays) if is_array(arrays[0]) and arrays[0].ndim else arrays[0],
        *bundles,
    )


def numbers(value: Any) -> Array:
    """An answer as a NumPy array."""
    return host(value.detach() if is_tensor(value) else value)


def is_array(value: Any) -> bool:
    """It is an array or a number of NumPy's, or a tensor."""
    return isinstance(value, np.ndarray | np.generic) or is_tensor(value)


def is_tensor(value: Any) -> bool:
    """It is a tensor of torch."""
    return "torch" in sys.modules and isinstance(value, sys.modules["torch"].Tensor)


def frozen(value: Any) -> Any:
    """What a value holds, to be compared with what it holds later; what is not data stands for itself."""
    if value is None or isinstance(value, str | bytes | bool | int | float | complex):
        return value
    if is_array(value):
        array = numbers(value)
        return type(value).__name__, array.dtype.str, array.shape, array.tobytes()
    if isinstance(value, set | frozenset):
        return frozenset(frozen(v) for v in value)
    inner = parts(value)
    if inner is not None:
        return type(value).__name__, tuple((k, frozen(v)) for k, v in inner.items())
    return id(value)


def shapes(bundle: Any) -> object:
    """The shapes of a bundle's arrays, to be compared with those of another one."""
    inner = parts(bundle)
    if inner is not None:
        return tuple((k, shapes(v)) for k, v in inner.items())
    return None if bundle is None or isinstance(bundle, str) else np.shape(numbers(bundle))


def without_worlds(bundle: Any, worlds: int, name: str) -> str:
    """The first part of a bundle that is no array with a row for each world, in words; empty for none."""
    inner = parts(bundle)
    if inner is not None:
        found = (without_worlds(value, worlds, f"{name}.{key}") for key, value in inner.items())
        return next((text for text in found if text), "")
    if bundle is None or isinstance(bundle, str):
        return ""
    if not is_array(bundle):
        return f"{name} is a {type(bundle).__name__}"
    return "" if bundle.shape[:1] == (worlds,) else f"{name} has the shape {tuple(bundle.shape)}"


def different(
    name: str, one: Sequence[Any], many: Any, tolerance: float = TOLERANCE, library: type | None = None
) -> list[str]:
    """How an answer to a batch differs from those to its worlds, one by one.

    Args:
        name: What is compared, for the sentences.
        one: Answers to worlds one by one, each with one row.
        many: The answer to the batch of these worlds.
        tolerance: Largest difference; 0: the bits are to be the same.
        library: Type that arrays should have.
    """
    inner = parts(one[0])
    if inner is not None:
        whole = parts(many)
        if whole is None or set(whole) != set(inner):
            return [f"{name}: a batch gives a {type(many).__name__}, not a {type(one[0]).__name__}"]
        each = [parts(o) or {} for o in one]
        out: list[str] = []
        for k, value in whole.items():
            out += different(f"{name}.{k}", [o.get(k) for o in each], value, tolerance, library)
        return out
    if one[0] is None or isinstance(one[0], str):
        return [] if many == one[0] else [f"{name}: a batch gives {many!r}, not {one[0]!r}"]
    each_row = [numbers(o) for o in one]
    together = numbers(many)
    if len({row.shape for row in each_row}) > 1 or not each_row[0].ndim:
        return [f"{name}: one by one it has the shapes {sorted({row.shape for row in each_row})}"]
    alone: Array = np.concatenate(each_row)
    if library is not None and not isinstance(many, library):
        return [f"{name}: gives a {type(many).__name__}"]
    if together.ndim == 0:
        return [f"{name}: a batch of {len(one)} gives one number"]
    if together.shape != alone.shape:
        return [f"{name}: a batch gives the shape {together.shape}, one by one it is {alone.shape}"]
    if (together.dtype == bool) != (alone.dtype == bool):
        return [f"{name}: a batch gives {together.dtype}, one by one it is {alone.dtype}"]
    return _unequal(name, together, alone, tolerance)


def _unequal(name: str, together: Array, alone: Array, tolerance: float) -> list[str]:
    if alone.dtype.kind not in "fiub":
        wrong = together != alone
        return [f"{name}: {wrong.sum()} of {wrong.size} texts differ"] if wrong.any() else []
    a, b = together.astype(float), alone.astype(float)
    close = np.isclose(a, b, rtol=0.0, atol=tolerance, equal_nan=True)
    if close.all():
        return []
    most = np.nanmax(np.abs(a - b))
    return [f"{name}: {np.sum(~close)} of {close.size} numbers differ, by up to {most:.3g}"]
