"""How much closer than usual one may come to things, by what is done: shares from 0 to 1.

What is planned first keeps more room than what follows it, since arms lag and estimates change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from bt_tasksim.core.errors import NoWayError

_Room = TypeVar("_Room")
_Found = TypeVar("_Found")

CARRIED = 0.2
"""On a way with something in the hand."""
NARROWLY = 0.5
"""The same where nothing leads there with that much room."""
CLOSER = 0.7
"""Where a hand takes hold of something, lifts it from between others, or draws back from it opened."""
BROUGHT = 0.8
"""Where something is brought to be put down, and on the way there where nothing else leads there."""
PUT_DOWN = 0.9
"""Where something is put down at last."""
TOUCHING = 1.0
"""Where nothing else serves: what is known to be there is not touched, and no room is kept around it."""
DROPPED = 0.006
"""Metres that something may fall when it is let go, where a hand cannot come down all the way."""
HIGHER = (0.012, 0.024)
"""The same before it is given up, or a way around is looked for: what has turned in the hand, or stands next
to a rim, leaves the fingers no room any lower."""
VERY_CLOSE = 0.9
"""At a grasp where nothing else serves."""
ROOMS = (0.4, 0.8, 1.0)
"""In what follows a grasp: the object moves in the hand when this closes, so a grasp that leaves more room is
taken where there is one."""


def with_room(rooms: Iterable[_Room], find: Callable[[_Room], _Found]) -> _Found:
    """What is found with the first of some rooms that will do; the others are not asked for.

    Raises:
        NoWayError: None will; what it says of the last one.
    """
    reason: NoWayError | None = None
    for room in rooms:
        try:
            return find(room)
        except NoWayError as error:
            reason = error.with_traceback(None)  # which would keep all that was made for it
    assert reason is not None, "there is a room to try"
    try:
        raise reason
    finally:
        del reason
