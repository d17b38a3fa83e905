"""When a part of a fixture counts as open, shut or set to a value: goals and conditions judge by these laws.

A part's value counts from 0, where its joint is as the fixture's file gives it. Shut is where the value is
least: at its lower limit, which is 0 of most parts. All is for ``N`` parts at once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace

OPEN = 0.8
"""Share of its way by which a part has to be open where nobody says how far."""
SHUT_SLIDE, SHUT_HINGE = 0.005, math.radians(2.0)
"""Metres or radians within which a part is shut."""


class ValueAsked(NamedTuple):
    """What is asked of parts, and what is so; metres where they slide, radians where they turn.

    Attributes:
        wanted: The value ``(N,)`` that counts.
        off: How far ``(N,)`` they are from it.
        so: Boolean ``(N,)``: it is reached.
    """

    wanted: Array
    off: Array
    so: Array


def opened(value: Array, limits: Array, by: float | None, slack: Array | float) -> ValueAsked:
    """Open ``by`` so much at least, up to some slack, or by `OPEN` of the whole way.

    Args:
        value: Values ``(N,)``.
        limits: Lowest and highest ones ``(N, 2)``.
        by: The value that is asked for.
        slack: What may be missing to that, one for all or ``(N,)``.
    """
    low, high = limits[:, 0], limits[:, 1]
    wanted = low + OPEN * (high - low) if by is None else by + 0.0 * low
    off = poses.clip(wanted - value, 0.0, math.inf)
    return ValueAsked(wanted, off, off <= (0.0 if by is None else slack))


def shut(value: Array, limits: Array, turns: Array) -> ValueAsked:
    """At the lower limit, up to `SHUT_SLIDE` or `SHUT_HINGE`; ``wanted`` is how far off it may be."""
    xp, off = array_namespace(value), value - limits[:, 0]
    allowed = xp.where(turns, xp.full_like(off, SHUT_HINGE), xp.full_like(off, SHUT_SLIDE))
    return ValueAsked(allowed, off, off <= allowed)


def set_to(value: Array, at: float, slack: Array | float) -> ValueAsked:
    """Just ``at`` that value, up to some slack."""
    off = abs(value - at)
    return ValueAsked(at + 0.0 * off, off, off <= slack)
