"""Lines in the space of an arm's joints, and in which order to ask about the points on them."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from bt_tasksim.core.poses import Array

STEP = 0.06
"""Radians of the joint that turns most, between two questions on a line."""


def line(a: Array, b: Array, step: float = STEP) -> Array:
    """Joints ``(n, n_arm)`` from ``a`` to ``b``, both ``(n_arm,)`` and both among them."""
    way = b - a
    n = max(2, math.ceil(float(np.abs(way).max()) / step) + 1)
    found: Array = a + _shares(n) * way
    return found


@lru_cache(maxsize=1024)
def _shares(n: int) -> Array:
    """Even shares ``(n, 1)`` from 0 to 1."""
    found = np.linspace(0.0, 1.0, n)[:, None]
    found.setflags(write=False)
    return found


def halves(points: Array) -> Array:
    """Points ``(n, ...)``, the middle one first and then ever finer between: what is touched shows early."""
    n = len(points)
    return points if n < 3 else points[_halving(n)]


@lru_cache(maxsize=1024)
def _halving(n: int) -> list[int]:
    """In which order `halves` has ``n`` points."""
    order, queue = [], [(0, n)]
    while queue:
        low, high = queue.pop(0)
        if low < high:
            middle = (low + high) // 2
            order.append(middle)
            queue += [(low, middle), (middle + 1, high)]
    return order
