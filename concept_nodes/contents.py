"""What is in a vessel, as far as is seen, or in truth: laws over arrays of worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes.view import WITHIN
from bt_tasksim.concept_nodes.whereabouts import Estimates, Truth
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.scene.spatial_laws import Whereabouts, beyond_walls


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
