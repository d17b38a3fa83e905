"""Limits that no task may exceed, judged from what a robot can observe."""

from __future__ import annotations

from bt_tasksim.context import Seen
from bt_tasksim.poses import Array, array_namespace

FORCE_LIMIT = 60.0
"""N at the wrist: well above what carrying and placing take, well below what breaks a cup or a finger."""


def strained(seen: Seen, limit: float) -> Array:
    """Boolean ``(...)``: the force at the wrist exceeds ``limit`` N."""
    force = seen.wrench[..., :3]
    xp = array_namespace(force)
    return xp.sum(force * force, axis=-1) > limit * limit


def force_at_wrist(seen: Seen) -> Array:
    """Magnitude ``(...)`` of the force at the wrist, N."""
    force = seen.wrench[..., :3]
    xp = array_namespace(force)
    return xp.sqrt(xp.sum(force * force, axis=-1))
