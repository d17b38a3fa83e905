"""What a hand, an arm or what is held seems to touch where it should not, in words for people."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.holding import holding
from bt_tasksim.concept_nodes.limits import force_at_wrist
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core.poses import host
from bt_tasksim.planning.things import Leave

FELT = 20.0
"""N at the wrist from which on it is asked what touches."""
NEAR = 0.5
"""Share of the room that is kept around things on the way, within which a thing counts as touched."""


def touched(seen: Seen, target: str, expected: Collection[str] = ()) -> tuple[str, ...]:
    """As in "; panda_hand touches the shelf", one for each world; empty where no force is felt.

    The robot feels a force and sees where things are; which of them are near enough to be its cause is
    computed.

    Args:
        seen: What is seen.
        target: The object that the concept acts on, which the hand may touch.
        expected: Names of what it may touch, too.
    """
    felt = np.asarray(host(force_at_wrist(seen))) > FELT
    if not felt.any():
        return ("",) * len(felt)
    held = np.asarray(host(holding(seen, target)))
    return tuple(
        _words(view, target, expected, bool(is_held)) if feels else ""
        for view, feels, is_held in zip(views(seen), felt, held, strict=True)
    )


def _words(view: WorldView, target: str, expected: Collection[str], is_held: bool) -> str:
    leave = Leave(hand={target}, held=set(expected))
    finder = view.finder(
        [target] if is_held else (),
        held=view.held(target) if is_held else None,
        leave=leave,
        closer=1.0 - NEAR,
    )
    pairs = finder.collisions.touches(view.arm)
    return "".join(f"; {a} touches {b}" for a, b in pairs[:2])
