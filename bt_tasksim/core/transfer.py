"""Between NumPy on the host and arrays of another library, or on another device: few and whole transfers.

Laws are computed where their inputs are. What decides which leaf is ticked where stays in NumPy, and so do
numbers of worlds. A transfer takes a device as long as some hundred operations of a law, nearly whatever its
size: so arrays go together, and numbers of rows once for all that is picked by them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from bt_tasksim.core.poses import Array, array_namespace, host


class Index:
    """Numbers of rows, which go to a device when something there is first picked by them.

    Args:
        rows: Which ``(k,)``, in NumPy or as a sequence; or booleans ``(N,)``.
    """

    __slots__ = ("_there", "rows")

    def __init__(self, rows: Array | Sequence[int]) -> None:
        # What is an array stays where it is, also on another device.
        found: Array = rows if hasattr(rows, "dtype") else np.array(rows, dtype=None if len(rows) else int)
        self.rows: np.ndarray = np.flatnonzero(found) if found.dtype == bool else found
        self._there: Array = None

    def __len__(self) -> int:
        return len(self.rows)

    def on(self, values: Array) -> Array:
        """The numbers ``(k,)`` where these values are, all of which are on one device."""
        if isinstance(values, np.ndarray):
            return self.rows
        if self._there is None:
            self._there = array_namespace(values).asarray(self.rows, device=values.device)
        return self._there

    def of(self, values: Array) -> Array:
        """These rows ``(k, ...)`` of values ``(N, ...)``."""
        if isinstance(values, np.ndarray):
            if values.ndim == 1:
                return values[self.rows]
            return values.take(self.rows, axis=0)  # twice as fast as an index where rows are short
        return array_namespace(values).take(values, self.on(values), axis=0)

    def along(self, values: Array, axis: int) -> Array:
        """These entries of values along an axis, side by side in memory."""
        if type(values) is np.ndarray:
            return values.take(self.rows, axis=axis)
        return array_namespace(values).take(values, self.on(values), axis=axis)

    def put(self, values: Array, new: Array) -> None:
        """Write ``new (k, ...)`` into these rows of values ``(N, ...)``."""
        values[self.on(values)] = new

    def replaced(self, values: Array, new: Array) -> Array:
        """Values ``(N, ...)`` like these, with ``new (k, ...)`` in these rows."""
        out = array_namespace(values).asarray(values, copy=True)
        self.put(out, new)
        return out


def spliced(arrays: Sequence[Array], rows: np.ndarray, new: Sequence[Array], axis: int = 0) -> list[Array]:
    """Arrays of ``N`` entries along an axis, those at ``rows (k,)`` being new ones; nothing is written to."""
    n = arrays[0].shape[axis]
    source = np.arange(n)
    source[rows] = n + np.arange(len(rows))
    index = Index(source)
    pairs = zip(arrays, new, strict=True)
    return [index.along(array_namespace(*pair).concat(list(pair), axis=axis), axis) for pair in pairs]


def sent(arrays: Sequence[np.ndarray], like: Array) -> list[Array]:
    """NumPy's arrays in the library and on the device of another one, in a transfer for each kind of number.

    Floating-point numbers get its type; for NumPy nothing is done.

    Args:
        arrays: Of any shapes.
        like: Where to.
    """
    if isinstance(like, np.ndarray):
        return list(arrays)
    xp = array_namespace(like)

    def send(whole: np.ndarray) -> Array:
        dtype = like.dtype if whole.dtype.kind == "f" else None
        return xp.asarray(whole, dtype=dtype, device=like.device)

    return _together(arrays, lambda array: array.dtype.str, np.concatenate, send)


def fetched(arrays: Sequence[Array]) -> list[np.ndarray]:
    """Arrays, wherever they are, in NumPy, in a transfer for each kind of number."""
    if all(isinstance(array, np.ndarray) for array in arrays):
        return list(arrays)
    if len(arrays) == 1:
        return [host(arrays[0])]
    xp = array_namespace(*arrays)
    return _together(arrays, lambda array: str(array.dtype), xp.concat, host)


def _together(
    arrays: Sequence[Array],
    kind: Callable[[Array], str],
    join: Callable[[list[Array]], Array],
    move: Callable[[Array], Array],
) -> list[Array]:
    """Arrays moved as one for each of their kinds, and taken apart again."""
    groups: dict[str, list[int]] = {}
    for i, array in enumerate(arrays):
        groups.setdefault(kind(array), []).append(i)
    out: list[Array] = [None] * len(arrays)
    for members in groups.values():
        if len(members) == 1:
            out[members[0]] = move(arrays[members[0]])
            continue
        xp = array_namespace(arrays[members[0]])
        whole, first = move(join([xp.reshape(arrays[i], (-1,)) for i in members])), 0
        there = array_namespace(whole)
        for i in members:
            shape = tuple(arrays[i].shape)
            last = first + int(np.prod(shape))
            out[i], first = there.reshape(whole[first:last], shape), last
    return out
