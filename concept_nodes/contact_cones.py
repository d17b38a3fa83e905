"""How many dimensions cones of feasible motions have, for many sets of contacts at once.

Contact normals ``n_i`` span a cone ``K``, and the feasible motions ``C = {t : n_i . t >= 0}`` are its dual.
So ``m = 3 - dim span K``, and what contacts on both sides forbid is the lineality space of ``K``, of ``c``
dimensions; ``d`` is the rest (A. J. Goldman and A. W. Tucker, "Polyhedral convex cones", 1956). In a plane,
``c`` follows from the largest gap between the directions of normals; in space from the direction that is
farthest from being forbidden, ``max_t min_i n_i . t``, and from the gap in the plane across it.

Measured normals are uncertain, and every decision here has room for that: directions count as equal up to an
angle, and of two classes that this cannot tell apart the one that holds the object more counts.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bt_tasksim.core.errors import InputError

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Integers = NDArray[np.int64]

EXACT = 1e-6
"""Radians up to which normals that are known exactly count as equal."""
MEASURED = float(np.deg2rad(1.0))
"""The same of a physics engine's."""
ROOM = 2.0
"""Each of two normals may be off: what is computed of both may be off by so many times as much."""
ACTIVE = 4.0
"""The same for a contact that holds the freest direction back."""
MOST, LARGEST = 60, 2_000
"""Normals of a set that may differ by more than the tolerance, since all triples of them are looked at; and
all of them, since all pairs are."""
MEMORY = 4_000_000
"""Numbers in the largest array at once."""


def padded(sets: Sequence[ArrayLike]) -> tuple[Floats, Booleans]:
    """Sets of vectors of different sizes as one array.

    Args:
        sets: ``S`` arrays ``(n, 3)``; ``n`` may be 0.

    Returns:
        The vectors ``(S, most, 3)``, zero where there is none, and booleans ``(S, most)`` where there is one.
    """
    arrays = [np.asarray(each, dtype=np.float64).reshape(-1, 3) for each in sets]
    most = max((len(each) for each in arrays), default=0)
    vectors, there = np.zeros((len(arrays), most, 3)), np.zeros((len(arrays), most), dtype=bool)
    for k, each in enumerate(arrays):
        vectors[k, : len(each)], there[k, : len(each)] = each, True
    return vectors, there


def numbers(what: str, values: ArrayLike, asked: str) -> Floats:
    """What somebody gives as an array.

    Args:
        what: What they are, for the sentence.
        values: The numbers.
        asked: What should be given, for the sentence.

    Raises:
        InputError: They are no numbers of one shape.
    """
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what}: no numbers of one shape; {asked}") from None


def vectors(what: str, values: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Finite numbers of a shape.

    Args:
        what: What they are, for the sentence.
        values: The numbers.
        shape: Their shape; -1 for any length, of which none at all may be given in any way.

    Raises:
        InputError: They have another shape, or are no finite numbers.
    """
    asked = f"give finite numbers of shape ({', '.join('n' if size < 0 else str(size) for size in shape)})"
    found = numbers(what, values, asked)
    if not found.size and -1 in shape:
        return np.zeros([max(size, 0) for size in shape])
    fits = found.ndim == len(shape) and all(n in (-1, m) for n, m in zip(shape, found.shape, strict=True))
    if not fits or not np.isfinite(found).all():
        raise InputError(f"{what}: shape {found.shape}, or not finite; {asked}")
    return found


def unit_normals(normals: Floats, there: Booleans) -> Floats:
    """Contact normals ``(S, most, 3)`` of length one; zero where there is none.

    Raises:
        InputError: The shapes are wrong, or a normal is zero or not finite.
    """
    if normals.ndim != 3 or normals.shape[2] != 3 or there.shape != normals.shape[:2]:
        raise InputError(
            f"contact normals have shape {normals.shape} and their mask {there.shape}; "
            "give arrays of shapes (sets, most, 3) and (sets, most)"
        )
    lengths = np.linalg.norm(normals, axis=2)
    bad = np.argwhere(there & (~np.isfinite(lengths) | (lengths < 1e-9)))
    if len(bad):
        which = f"contact normal {bad[0, 1]}" + (f" of set {bad[0, 0]}" if len(normals) > 1 else "")
        raise InputError(f"{which} is zero or not finite; give a direction")
    unit: Floats = np.where(there[..., None], normals / np.where(there, lengths, 1.0)[..., None], 0.0)
    return unit


def cone_dimensions(normals: Floats, there: Booleans, tolerance: float = EXACT) -> Integers:
    """Maintaining, detaching and constraining dimensions of cones ``{t : n_i . t >= 0}``.

    Args:
        normals: Normals ``(S, most, 3)`` that point into the object; their length is of no account.
        there: Booleans ``(S, most)``: there is one.
        tolerance: Radians up to which directions count as equal. Measured normals need twice the angle by
            which they are uncertain.

    Returns:
        The three of each set ``(S, 3)``; their sum is 3.

    Raises:
        InputError: A shape is wrong, a normal is zero or not finite, or there are too many, see `MOST`.
    """
    if not 0.0 <= tolerance < 0.2:
        raise InputError(f"the tolerance of contact normals is {tolerance} rad; give one from 0 to 0.2")
    tolerance = max(float(tolerance), EXACT)
    unit = unit_normals(normals, there)
    if unit.shape[1] > LARGEST:
        raise InputError(f"a set has {unit.shape[1]} contact normals, and at most {LARGEST} are looked at")
    unit, there = _different(unit, there, tolerance)
    counts = there.sum(axis=1)
    if len(counts) and counts.max() > MOST:
        raise InputError(
            f"set {counts.argmax()} has {counts.max()} contact normals that differ by more than "
            f"{tolerance:.2g} rad, and at most {MOST} are told apart: give fewer, or a larger tolerance"
        )
    out = np.zeros((len(unit), 3), dtype=np.int64)
    for count in np.unique(counts):
        rows = np.flatnonzero(counts == count)
        most = max(1, MEMORY // max(len(_triples(int(count))) * int(count), 1))
        for first in range(0, len(rows), most):
            some = rows[first : first + most]
            out[some] = _dimensions(unit[some, :count], tolerance)
    return out


def _different(unit: Floats, there: Booleans, tolerance: float) -> tuple[Floats, Booleans]:
    """Of normals that count as equal one; those that are left stand first."""
    close = np.einsum("sik,sjk->sij", unit, unit) > np.cos(tolerance)
    kept = there.copy()
    for k in range(1, unit.shape[1]):
        kept[:, k] &= ~(close[:, k, :k] & kept[:, :k]).any(axis=1)
    order = np.argsort(~kept, axis=1, kind="stable")
    return np.take_along_axis(unit, order[..., None], axis=1), np.take_along_axis(kept, order, axis=1)


def _dimensions(unit: Floats, tolerance: float) -> Integers:
    """The same ``(S, 3)`` of sets with equally many normals ``(S, n, 3)``, none of them equal."""
    sets, count = unit.shape[:2]
    if count == 0:
        return np.tile(np.array([3, 0, 0]), (sets, 1))
    across, _, along = _axes(unit)
    room = ROOM * tolerance
    beside = np.linalg.norm(np.cross(unit, along[:, None]), axis=2).max(axis=1)
    line = beside <= room
    plane = ~line & (np.abs(_dots(unit, across)).max(axis=1) <= room)
    rank = np.where(line, 1, np.where(plane, 2, 3))
    c = np.zeros(sets, dtype=np.int64)
    if line.any():
        side = _dots(unit[line], along[line])
        c[line] = (side > 0.0).any(axis=1) & (side < 0.0).any(axis=1)
    if plane.any():
        gap = _largest_gap(unit[plane], across[plane], np.ones((int(plane.sum()), count), dtype=bool))
        c[plane] = np.where(gap > np.pi + room, 0, np.where(gap < np.pi - room, 2, 1))
    space = rank == 3
    if space.any():
        c[space] = _constrained(unit[space], tolerance)
    return np.stack([3 - rank, rank - c, c], axis=1)


def _constrained(unit: Floats, tolerance: float) -> Integers:
    """Constraining dimensions ``(S,)`` of normals ``(S, n, 3)`` that span all of space."""
    freest, least = _freest(unit)
    room = ROOM * tolerance
    held_back = _dots(unit, freest) <= least[:, None] + ACTIVE * tolerance
    gap = _largest_gap(unit, freest, held_back)
    flat = np.where(gap < np.pi - ROOM * room, 2, 1)
    return np.where(least > room, 0, np.where(least < -room, 3, flat))


def _freest(unit: Floats) -> tuple[Floats, Floats]:
    """The directions ``(S, 3)`` for which the least ``n_i . t`` is the largest, and that ``(S,)``.

    At such a direction one normal, two or three are the least, and equally large.
    """
    sets, count = unit.shape[:2]
    one, two, three = (unit[:, column] for column in _triples(count).T)
    equal = np.cross(two - one, three - one)
    first, second = np.triu_indices(count, k=1)
    between = unit[:, first] + unit[:, second]
    candidates = np.concatenate([equal, -equal, between, unit], axis=1)
    length = np.linalg.norm(candidates, axis=2, keepdims=True)
    candidates = candidates / np.where(length > 1e-9, length, np.inf)
    least = (candidates @ unit.transpose(0, 2, 1)).min(axis=2)
    least = np.where(length[..., 0] > 1e-9, least, -np.inf)
    best = least.argmax(axis=1)
    rows = np.arange(sets)
    return candidates[rows, best], least[rows, best]


def _largest_gap(unit: Floats, axis: Floats, counts: Booleans) -> Floats:
    """The largest angle ``(S,)`` between neighbours among directions ``(S, n, 3)``, seen along an axis."""
    x = np.cross(axis, np.eye(3)[np.abs(axis).argmin(axis=1)])
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    angles = np.arctan2(_dots(unit, np.cross(axis, x)), _dots(unit, x))
    some = np.take_along_axis(angles, counts.argmax(axis=1)[:, None], axis=1)
    angles = np.sort(np.where(counts, angles, some), axis=1)
    gaps = np.diff(angles, axis=1, append=angles[:, :1] + 2.0 * np.pi)
    largest: Floats = gaps.max(axis=1)
    return largest


def _axes(unit: Floats) -> tuple[Floats, Floats, Floats]:
    """The principal axes ``(S, 3)`` of directions ``(S, n, 3)``, that with the least along it first."""
    axes = np.linalg.eigh(np.einsum("snk,snl->skl", unit, unit))[1]
    return axes[:, :, 0], axes[:, :, 1], axes[:, :, 2]


def _dots(vectors: Floats, direction: Floats) -> Floats:
    """Products ``(S, n)`` of vectors ``(S, n, 3)`` with a direction ``(S, 3)``."""
    products: Floats = np.einsum("snk,sk->sn", vectors, direction)
    return products


@lru_cache(maxsize=64)
def _triples(count: int) -> Integers:
    """All choices ``(k, 3)`` of three out of so many."""
    return np.array(list(itertools.combinations(range(count), 3)), dtype=np.int64).reshape(-1, 3)
