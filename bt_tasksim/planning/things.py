"""What a robot keeps clear of, what it holds, and what may touch nevertheless."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import coal
import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.scene.hulls import convex

Touch = tuple[str, str]
"""Names of two things that touch: of a link of the robot or of what is held, and of what it touches."""

SKIN, LEAST = 0.006, 0.4
"""Metres at a thing's surface that may be touched where it seems to be touched already, since estimates are
wrong by some; and the share of a thin thing's width that may not."""


@dataclass(frozen=True, eq=False)
class Thing:
    """Something to keep clear of.

    Attributes:
        name: Its name, for people.
        pose: Pose ``(7,)``, robot base frame.
        size: Full size ``(3,)`` of a box; None where ``pieces`` say what it is.
        pieces: Corners ``(n, 3)`` of convex pieces, in its own frame.
        margin: Metres of free space to keep around it.
    """

    name: str
    pose: Array
    size: tuple[float, float, float] | None = None
    pieces: Sequence[Array] = ()
    margin: float = 0.0


@dataclass(frozen=True, eq=False)
class Held:
    """What moves with the tool.

    Attributes:
        name: Its name.
        grip: Its pose ``(7,)`` in the tool frame.
        pieces: Corners ``(n, 3)`` of convex pieces, in its own frame.
    """

    name: str
    grip: Array
    pieces: Sequence[Array]


@dataclass(frozen=True)
class Leave:
    """What may touch nevertheless.

    Attributes:
        hand: Names of things that the hand may touch.
        held: Names of things that what is held may touch.
        robot: Names of things that nothing is compared with.
        pairs: Names of a link, or of what is held, and of what it may touch.
    """

    hand: Collection[str] = field(default_factory=frozenset)
    held: Collection[str] = field(default_factory=frozenset)
    robot: Collection[str] = field(default_factory=frozenset)
    pairs: Collection[Touch] = field(default_factory=frozenset)


def inner(thing: Thing) -> list[Thing]:
    """The inside of each piece of a thing, every side by `SKIN` farther in, or by as much as leaves some."""
    pieces = [box_corners(thing.size)] if thing.size is not None else thing.pieces
    return [
        Thing(f"the inside of {thing.name}, piece {k}", thing.pose, pieces=[_inner(np.asarray(piece))])
        for k, piece in enumerate(pieces)
    ]


def _inner(piece: Array) -> Array:
    low, high = piece.min(axis=0), piece.max(axis=0)
    left = np.maximum(1.0 - 2.0 * SKIN / np.maximum(high - low, 1e-9), LEAST)
    middle = (low + high) / 2
    found: Array = middle + left * (piece - middle)
    return found


def shapes_of(thing: Thing) -> list[Any]:
    """A thing's solids as coal's shapes, without its margin."""
    if thing.size is not None:
        return [coal.Box(*(float(s) for s in thing.size))]
    return [convex(piece) for piece in thing.pieces]


def box_corners(size: Sequence[float]) -> Array:
    """Corners ``(8, 3)`` of a box of full ``size (3,)`` about the origin."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    found: Array = signs * np.asarray(size, float) / 2
    return found
