"""Arrays of objects in common columns: what worlds have each in their own order, put in order by name.

A physics engine and a perception engine know no names: in their arrays the objects of each world stand in
the order of its `WorldModel`, and those of worlds with fewer are filled up. `Order` says where in them each
column of `bt_tasksim.core.facts.WorldFacts` is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.transfer import Index
from bt_tasksim.core.world import Hidden, Observation, WorldModel

OF_OBJECTS = ("objects", "velocities", "hand_force", "hand_distance")
"""Arrays ``(N, n_objects, ...)`` of `Observation` and `Hidden`."""
ABSENT = -1
_T = TypeVar("_T", Observation, Hidden)


class Order:
    """Where the columns stand in each world's own order of objects.

    Args:
        own: ``(N, n_columns)`` position of each column's object in its world; `ABSENT` where it has none.
    """

    def __init__(self, own: Array) -> None:
        self.own = own
        self._usual = bool(((own == np.arange(own.shape[1])) | (own == ABSENT)).all())

    @classmethod
    def of(cls, worlds: Sequence[WorldModel], names: Sequence[str]) -> Order:
        """The order of worlds, one row each, in columns of these names."""
        own = [[world.index.get(name, ABSENT) for name in names] for world in worlds]
        return cls(np.array(own, int).reshape(len(worlds), len(names)))

    def replaced(self, rows: Array, other: Order) -> Order:
        """The same order, with that of other worlds, in the same columns, at ``rows (k,)``."""
        own = self.own.copy()
        own[rows] = other.own
        return Order(own)

    def arranged(self, bundle: _T, rows: Array | None = None) -> _T:
        """An observation, or a hidden state, with an array's column for each name.

        It is the same one where that is so already, as in worlds that order their objects alike. Otherwise
        each array is made when somebody looks at it: NaN, or False, where a world has no such object.

        Args:
            bundle: ``(k, ...)``, each world in its own order.
            rows: Which worlds these are ``(k,)``; by default all.
        """
        if self._usual and bundle.objects.shape[1] == self.own.shape[1]:
            return bundle
        found: _T = _Arranged(bundle, self.own if rows is None else self.own[rows])  # type: ignore[assignment]
        return found


class _Arranged:
    """A bundle whose arrays of objects are arranged, each when it is first looked at."""

    def __init__(self, bundle: Any, own: Array) -> None:
        self._bundle, self._own = bundle, own

    def __getattr__(self, name: str) -> Array:
        if name.startswith("__"):
            raise AttributeError(name)
        values = getattr(self._bundle, name)
        if name in OF_OBJECTS:
            values = _picked(values, self._own)
        elif name == "support":
            values = _support(values, self._own)
        self.__dict__[name] = values
        return values


def _support(values: Array, own: Array) -> Array:
    """`Hidden.support` whose bodies are the objects by column, and then each world's own fixtures."""
    xp, objects = array_namespace(values), values.shape[1]
    bodies = np.where(own < objects, own, ABSENT)
    fixtures = np.broadcast_to(np.arange(objects, values.shape[2]), (len(own), values.shape[2] - objects))
    touched = xp.permute_dims(_picked(values, own), (0, 2, 1))
    return xp.permute_dims(_picked(touched, np.concatenate([bodies, fixtures], axis=1)), (0, 2, 1))


def _picked(values: Array, index: np.ndarray) -> Array:
    """Of ``values (N, w, ...)`` the entries ``index (N, n)`` of each; NaN or False where there is none."""
    xp, (worlds, width), inner = array_namespace(values), values.shape[:2], values.shape[2:]
    nothing = False if values.dtype == xp.bool else np.nan
    out = xp.full((*index.shape, *inner), nothing, dtype=values.dtype, device=values.device)
    there = (index != ABSENT) & (index < width)
    if not there.any():
        return out
    numbers = np.arange(worlds)[:, None] * width + np.where(there, index, 0)
    picked = Index(numbers.reshape(-1)).of(xp.reshape(values, (worlds * width, *inner)))
    known = xp.reshape(xp.asarray(there, device=values.device), (*index.shape, *(1,) * len(inner)))
    return xp.where(known, xp.reshape(picked, out.shape), out)


def with_rows(array: Array, index: Index, values: Array, filling: Any) -> Array:
    """An array ``(N, ...)`` with other rows ``(k, ...)``; what is shorter is filled up."""
    most = tuple(max(n, m) for n, m in zip(array.shape[1:], values.shape[1:], strict=True))
    values = values if most == tuple(values.shape[1:]) else filled(values, most, filling)
    if most == tuple(array.shape[1:]):
        return index.replaced(array, values)
    out = filled(array, most, filling)
    index.put(out, values)
    return out


def filled(array: Array, most: tuple[int, ...], filling: Any) -> Array:
    """An array ``(n, ...)`` as ``(n, *most)``."""
    xp = array_namespace(array)
    out = xp.asarray(xp.broadcast_to(constant(filling, array), (array.shape[0], *most)), copy=True)
    out[(slice(None), *(slice(0, n) for n in array.shape[1:]))] = array
    return out
