"""Limits that no task may exceed, judged from what a robot can observe."""

from __future__ import annotations

from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.poses import Array, norm
from bt_tasksim.core.units import NEWTONS

FIRM = 0.3
"""Metres between the arm's base and its tool within which it goes slower still, in proportion: the same
drives press harder there. The SO-100, 0.14 m from its base, meets a table at 24 mm/s with 71 N."""
FORCE_LIMIT = 60.0
"""N at the wrist: well above what carrying and placing take, well below what breaks a cup or a finger."""
WRIST_STRAINED = register_reason(
    "wrist_strained", "force at the wrist is {value:.3g}, above {limit:.3g}", value=NEWTONS, limit=NEWTONS
)


def strain(seen: Seen, limit: float) -> Limit:
    """The force at the wrist may be ``limit`` N: else the hand or the object presses against something."""
    return Limit(WRIST_STRAINED, force_at_wrist(seen), limit)


def force_at_wrist(seen: Seen) -> Array:
    """Magnitude ``(N,)`` of the force at the wrist, N."""
    return norm(seen.wrench[:, :3])
