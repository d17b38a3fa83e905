"""Values of a part's joint at which tasks end; they count from 0, and stay within the joint's limits."""

from __future__ import annotations

from bt_tasksim.core.poses import Array, array_namespace


def at_value(asked: float, now: Array, limits: Array) -> Array:
    """The value ``(N,)`` that is asked for.

    Args:
        asked: It, metres or radians.
        now: The present one ``(N,)``.
        limits: Lowest and highest ``(N, 2)``.
    """
    xp = array_namespace(now)
    return xp.minimum(xp.maximum(limits[:, 0], asked + 0.0 * now), limits[:, 1])


def open_by(asked: float | None, now: Array, limits: Array) -> Array:
    """The value ``(N,)`` at which it is open so far at least, by default wholly; more stays as it is.

    Args:
        asked: How far, metres or radians.
        now: The present value ``(N,)``.
        limits: Lowest and highest ``(N, 2)``.
    """
    return limits[:, 1] if asked is None else array_namespace(now).maximum(at_value(asked, now, limits), now)


def nearer_stop(now: Array, limits: Array) -> tuple[Array, Array]:
    """The value ``(N,)`` of the stop that is nearer, and the sign ``(N,)`` of the way there.

    Args:
        now: The present value ``(N,)``.
        limits: Lowest and highest ``(N, 2)``.
    """
    xp = array_namespace(now)
    high = 2.0 * now > limits[:, 0] + limits[:, 1]
    way = xp.where(high, xp.ones_like(now), -xp.ones_like(now))
    return xp.where(high, limits[:, 1], limits[:, 0]), way
