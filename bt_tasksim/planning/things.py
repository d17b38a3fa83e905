"""What a robot keeps clear of, what it holds, and what may touch nevertheless."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.core.convex_hulls import convex
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.boxes import box_of
from bt_tasksim.robot.kinematics.models import se3
from bt_tasksim.scene.chords import faces

Touch = tuple[str, str]
"""Names of two things that touch: of a link of the robot or of what is held, and of what it touches."""

SKIN, LEAST = 0.006, 0.4
"""Metres at a thing's surface that may be touched where it seems to be touched already, since estimates are
wrong by some; and the share of a thin thing's width that may not."""
_THINNEST = 1e-4
"""Metres of the radius of the largest ball within a piece from which on it has an inside."""


class Solids(NamedTuple):
    """A thing as coal's shapes.

    Attributes:
        placement: Where it is, in Pinocchio's form.
        shapes: Its solids with its margin swept about them.
        boxes: Boxes about these ``(k, 4, 4)``, robot base frame, see `box_of`.
    """

    placement: Any
    shapes: Sequence[Any]
    boxes: Array


@dataclass(frozen=True, eq=False)
class Thing:
    """Something to keep clear of.

    Attributes:
        name: Its name, for people.
        pose: Pose ``(7,)``, robot base frame.
        size: Full size ``(3,)`` of a box; None where ``pieces`` say what it is.
        pieces: Corners ``(n, 3)`` of convex pieces, in its own frame.
        margin: Metres of free space to keep around it.
        key: What tells it from others of its name, see `told_apart`.
    """

    name: str
    pose: Array
    size: tuple[float, float, float] | None = None
    pieces: Sequence[Array] = ()
    margin: float = 0.0
    key: str = ""

    @cached_property
    def solids(self) -> Solids:
        """It as coal's shapes; nobody writes to them."""
        shapes, placement = shapes_of(self), se3(self.pose)
        for shape in shapes:
            shape.setSweptSphereRadius(self.margin)
        at = placement.homogeneous
        return Solids(placement, shapes, np.array([box_of(shape, at) for shape in shapes]).reshape(-1, 4, 4))

    @property
    def known_as(self) -> str:
        """What it is called among others."""
        return self.key or self.name


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
        pairs: Names of a link, or of what is held, and of what it may touch, by its name or its key.
    """

    hand: Collection[str] = field(default_factory=frozenset)
    held: Collection[str] = field(default_factory=frozenset)
    pairs: Collection[Touch] = field(default_factory=frozenset)


def inner(thing: Thing) -> list[Thing]:
    """The inside of each piece of a thing that has one, see `shrunk`."""
    pieces = [box_corners(thing.size)] if thing.size is not None else thing.pieces
    inside = [(k, shrunk(np.asarray(piece))) for k, piece in enumerate(pieces)]
    return [
        Thing(
            f"the inside of {thing.name}, piece {k}",
            thing.pose,
            pieces=[corners],
            key=f"the inside of {thing.known_as}, piece {k}",
        )
        for k, corners in inside
        if corners is not None
    ]


def told_apart(things: Sequence[Thing]) -> list[Thing]:
    """The things, each of those that share a name, as the boards of a shelf do, with a key of its own."""
    shared = Counter(thing.name for thing in things)
    return [
        replace(thing, key=f"{thing.name}, part {k}") if shared[thing.name] > 1 and not thing.key else thing
        for k, thing in enumerate(things)
    ]


def shrunk(piece: Array) -> Array | None:
    """Corners ``(m, 3)`` of the inside of a convex piece, None where it has none.

    Every face is `SKIN` farther in, or by less where the piece is so thin that less than `LEAST` of the ball
    that fits into it were left.

    Args:
        piece: Corners ``(n, 3)`` of the piece.
    """
    return _shrunk(np.ascontiguousarray(piece, float).tobytes())


@lru_cache(maxsize=1024)
def _shrunk(corners: bytes) -> Array | None:
    from scipy.optimize import linprog
    from scipy.spatial import HalfspaceIntersection, QhullError

    try:
        planes = np.array(faces(np.frombuffer(corners).reshape(-1, 3)))
        # The middle and the radius of the largest ball within the piece.
        ball = linprog(
            [0.0, 0.0, 0.0, -1.0],
            A_ub=np.c_[planes[:, :3], np.ones(len(planes))],
            b_ub=-planes[:, 3],
            bounds=[(None, None)] * 3 + [(0.0, None)],
        )
        if ball.x is None or ball.x[3] < _THINNEST:
            return None
        planes[:, 3] += min(SKIN, (1.0 - LEAST) * float(ball.x[3]))
        found: Array = np.unique(HalfspaceIntersection(planes, ball.x[:3]).intersections.round(9), axis=0)
    except QhullError:  # it is flat
        return None
    found.setflags(write=False)
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
