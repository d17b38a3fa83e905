"""How far an object is from being in a container, or within the box about another object, as it is seen."""

from __future__ import annotations

from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.poses import Array, array_namespace, localise

SUNK = 0.01
"""Metres by which an object's centre may seem to be below a container's floor, and its lowest point above it
where it stands on it; as goals have it."""


def beyond_walls(seen: Seen, target: str, place: str) -> Array:
    """Metres ``(N,)`` by which an object's middle is outside, the largest along any axis; below 0 inside.

    Above a container's rim it is outside, unless it stands on the floor: a low tray has things in it that are
    taller.

    Args:
        seen: What is seen.
        target: The object.
        place: The container, or another object.
    """
    if place not in seen.world.place_columns:
        local = localise(seen.object(place), seen.object(target)[:, :3])
        xp = array_namespace(local)
        return xp.max(abs(local) - seen.model(place).extent / 2, axis=-1)
    box = seen.place(place)
    local = localise(box.pose, seen.object(target)[:, :3])
    xp = array_namespace(local)
    aside = xp.max(abs(local[:, :2] - box.centre) - box.extent / 2, axis=-1)
    rim = xp.maximum(box.height, seen.model(target).standing_height + SUNK)
    return xp.maximum(aside, xp.maximum(local[:, 2] - rim, -SUNK - local[:, 2]))
