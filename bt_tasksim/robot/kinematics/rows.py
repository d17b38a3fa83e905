"""Rows of arrays whose rows come last: those that a mask names, and putting pieces together again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from bt_tasksim.core.poses import Array, array_namespace, host, indices
from bt_tasksim.core.transfer import Index, spliced


def where_true(mask: Array) -> np.ndarray:
    """Indices ``(k,)`` of the rows that a mask ``(N,)`` names."""
    return np.flatnonzero(host(mask))


def taken(array: Array, rows: np.ndarray) -> Array:
    """The named rows ``(..., k)`` of an array ``(..., N)``."""
    return Index(rows).along(array, -1)


def taken_of(arrays: Iterable[Array], rows: np.ndarray) -> list[Array]:
    """`taken` of several arrays."""
    index = Index(rows)
    return [index.along(array, -1) for array in arrays]


def put(array: Array, rows: np.ndarray, values: Array) -> Array:
    """An array ``(..., N)`` whose named rows are ``values (..., k)``."""
    return put_in((array,), rows, (values,))[0]


def put_in(arrays: Sequence[Array], rows: np.ndarray, values: Sequence[Array]) -> list[Array]:
    """`put` of several arrays of as many rows."""
    return spliced(arrays, rows, values, axis=-1)


def joined(pieces: Sequence[Sequence[Array]], rows: Sequence[np.ndarray]) -> list[Array]:
    """Arrays ``(..., N)`` whose rows ``rows[i]`` are ``pieces[i]``; every row is in one piece."""
    if len(pieces) == 1:
        return list(pieces[0])
    index = Index(np.argsort(np.concatenate(rows)))
    whole = (array_namespace(*parts).concat(list(parts), axis=-1) for parts in zip(*pieces, strict=True))
    return [index.along(array, -1) for array in whole]


def columns(array: Array) -> Array:
    """Rows ``(N, k)`` as columns ``(k, N)``, each component's worlds side by side in memory."""
    return contiguous(array_namespace(array).permute_dims(array, (1, 0)))


def contiguous(array: Array) -> Array:
    """The same numbers, side by side in memory where the library can say so."""
    if type(array) is np.ndarray:
        return np.ascontiguousarray(array)
    return array.contiguous() if hasattr(array, "contiguous") else array


# What follows is the library's own, said shortly for NumPy, whose wrappers take longer than few rows.


def some(mask: Array) -> bool:
    """An element of a mask is true."""
    if type(mask) is np.ndarray:
        return bool(np.count_nonzero(mask))
    return bool(array_namespace(mask).any(mask))


def every(mask: Array) -> bool:
    """All elements of a mask are true."""
    if type(mask) is np.ndarray:
        return bool(np.count_nonzero(mask) == mask.size)
    return bool(array_namespace(mask).all(mask))


def either(mask: Array) -> Array:
    """An element ``(N,)`` of each row of a mask ``(k, N)`` is true."""
    if type(mask) is np.ndarray:
        return np.logical_or.reduce(mask, axis=0)
    return array_namespace(mask).any(mask, axis=0)


def highest(values: Array) -> Array:
    """Largest ``(N,)`` of values ``(k, N)``."""
    if type(values) is np.ndarray:
        return np.maximum.reduce(values, axis=0)
    return array_namespace(values).max(values, axis=0)


def at_least(values: Array, low: float) -> Array:
    """Values, and where they are smaller the bound."""
    if type(values) is np.ndarray:
        return np.maximum(values, low)
    return array_namespace(values).clip(values, min=low)


def chosen(array: Array, index: np.ndarray) -> Array:
    """Entries ``(k, ...)`` of the first axis by their indices."""
    if type(array) is np.ndarray:
        return array.take(index, axis=0)
    return array_namespace(array).take(array, indices(index, array), axis=0)
