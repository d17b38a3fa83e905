"""What is in a vessel, as far as is seen, or in truth, and what keeps it there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Protocol, TypeVar

from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.view import WITHIN, WorldView
from bt_tasksim.concept_nodes.whereabouts import Estimates, Truth
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.scene.spatial_laws import Whereabouts, beyond_walls

SPILLS = math.radians(30.0)
"""Lean at which what lies in a vessel may fall out."""


class Way(Protocol):
    """A way on which something is turned."""

    @property
    def poses(self) -> Array:
        """Poses ``(n, 7)`` on it."""


W = TypeVar("W", bound=Way)


def spilling_none(view: WorldView, target: str, ways: Sequence[W]) -> list[W]:
    """Of the ways to turn something those on which what lies in it stays there: all where nothing does.

    A vessel that leans already may lean as much.

    Raises:
        NoWayError: There are ways, and something would fall out on each.
    """
    inside = view.contents(target)
    if not inside or not ways:
        return list(ways)
    most = max(SPILLS, float(poses.tilt(view.objects[target][3:])) + 1e-6)
    kept = [way for way in ways if float(poses.tilt(way.poses[:, 3:]).max()) <= most]
    if not kept:
        raise NoWayError(
            f"{inside[0]} would fall out of {target} as it is turned: empty it first, or use Pour"
        )
    return kept


def seen_within(seen: Seen, vessel: str, names: Sequence[str]) -> Array:
    """Booleans ``(N, n_objects)``: things seem to be in a vessel, by their columns.

    Args:
        seen: What is seen.
        vessel: A container, or an object with a hollow.
        names: What is asked about; others are not in it.
    """
    return _within(Estimates.of(seen), seen.world.columns, vessel, names, WITHIN)


def outside(seen: Seen, vessel: str, names: Sequence[str]) -> Array:
    """Booleans ``(N, n_objects)``: things are seen, and not in a vessel, see `seen_within`."""
    xp = array_namespace(seen.tool)
    known = xp.all(xp.isfinite(seen.objects), axis=-1)
    return known & ~seen_within(seen, vessel, names)


def known_within(known: Known, vessel: str, names: Sequence[str]) -> Array:
    """Booleans ``(N, n_objects)``: things truly are in a vessel, see `seen_within`."""
    return _within(Truth(known), known.world.columns, vessel, names, 0.0)


def _within(
    where: Whereabouts, columns: Mapping[str, int], vessel: str, names: Sequence[str], tolerance: float
) -> Array:
    far = {columns[name]: beyond_walls(where, name, vessel) for name in names}
    like = where.hollow(vessel).frame[:, 0]
    xp = array_namespace(like)
    never = xp.zeros_like(like) > 1.0
    count = max(columns.values()) + 1
    return xp.stack([far[k] <= tolerance if k in far else never for k in range(count)], axis=-1)
