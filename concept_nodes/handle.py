"""When a part of furniture is in the hand, and why something is none."""

from __future__ import annotations

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.holding import AT_HANDLE, EMPTY, off_handle
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.poses import Array, array_namespace

NO_PART = register_reason("no_part", "{object} is no part of furniture: nothing is known of how it moves")
OTHER_PART = {
    True: register_reason("does_not_turn", "{object} slides, and does not turn"),
    False: register_reason("does_not_slide", "{object} turns, and does not slide"),
}
"""By whether it should turn."""


def at_handle(seen: Seen, target: str) -> Array:
    """Boolean ``(N,)``: fingers touch something where a part has a handle."""
    felt = array_namespace(seen.tool).any(seen.contacts, axis=-1)
    return felt & (off_handle(seen, target) < AT_HANDLE)


def about_handle(seen: Seen, target: str) -> Array:
    """Boolean ``(N,)``: the fingers of a hand that was at a part's handle are about it still.

    They need not be felt: what slides in a soft hand is touched by no fingertip for an instant. A hand that
    has lost it closes all the way.
    """
    felt = array_namespace(seen.tool).any(seen.contacts, axis=-1)
    return (felt | (seen.closure < EMPTY)) & (off_handle(seen, target) < AT_HANDLE)
