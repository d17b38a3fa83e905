"""Values of a part's joint at which tasks end; they count from 0."""

from __future__ import annotations

from bt_tasksim.core.poses import Array, array_namespace


def open_by(asked: float | None, now: Array, limits: Array) -> Array:
    """The value ``(N,)`` at which it is open so far at least, by default wholly; more stays as it is.

    Args:
        asked: How far, metres or radians.
        now: The present value ``(N,)``.
        limits: Lowest and highest ``(N, 2)``.
    """
    return limits[:, 1] if asked is None else array_namespace(now).maximum(asked + 0.0 * now, now)


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
