"""Limits that no task may exceed, judged from what a robot can observe."""

from __future__ import annotations

from bt_tasksim.concept.context import Seen
from bt_tasksim.core.poses import Array, norm

FORCE_LIMIT = 60.0
"""N at the wrist: well above what carrying and placing take, well below what breaks a cup or a finger."""


def strained(seen: Seen, limit: float) -> Array:
    """Boolean ``(...)``: the force at the wrist exceeds ``limit`` N."""
    return force_at_wrist(seen) > limit


def force_at_wrist(seen: Seen) -> Array:
    """Magnitude ``(...)`` of the force at the wrist, N."""
    return norm(seen.wrench[..., :3])
