"""Where an arm is expected to be whose drives follow their targets with a lag.

A drive of stiffness k and damping d that is told positions alone is behind them by d / k seconds. An arm that
goes at 2 rad/s is 0.2 rad beside its targets then, and all is well; so what counts as tracking error is how
far it is beyond both, its target and where such a drive would be.
"""

from __future__ import annotations

import math

import numpy as np

from bt_tasksim.core.poses import Array


def followed_lagging(before: Array, start: Array, end: Array, seconds: float, lag: float) -> Array:
    """Joints ``(n,)`` after a target has gone evenly from one place to another.

    The response of a first-order lag to a ramp (K. Ogata, "Modern Control Engineering", 5th edition, section
    5.2).

    Args:
        before: Where the joints were ``(n,)``.
        start: Where the target was ``(n,)``.
        end: Where it is now ``(n,)``.
        seconds: How long that took.
        lag: Seconds that the joints are behind; none, and they are where the target is.
    """
    if lag <= 0.0 or seconds <= 0.0:
        return end if lag <= 0.0 else before
    behind = lag * (end - start) / seconds
    found: Array = end - behind + (before - start + behind) * math.exp(-seconds / lag)
    return found


def beyond(measured: Array, expected: Array, target: Array) -> Array:
    """How far ``(n,)`` joints are from all places between where they are expected and their target."""
    low, high = np.minimum(expected, target), np.maximum(expected, target)
    found: Array = np.maximum(np.maximum(low - measured, measured - high), 0.0)
    return found
