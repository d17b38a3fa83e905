"""What holds things up that are slid: the walls beside one, how far away they are, and in which direction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array, constant
from bt_tasksim.planning.surroundings import things_of
from bt_tasksim.planning.things import Thing, box_corners
from bt_tasksim.scene.outlines import Slab, hull, nearest_way
from bt_tasksim.scene.relations.against import beside

UP = np.array([0.0, 0.0, 1.0])


class Stop(NamedTuple):
    """The nearest wall of a thing.

    Attributes:
        gap: Metres to it; negative where they seem to overlap.
        towards: Level unit vector ``(3,)`` in which the thing comes to it.
    """

    gap: float
    towards: Array


def nearest_stop(view: WorldView, target: str, other: str | None = None) -> Stop | None:
    """The nearest wall beside a thing, as far as is seen and known; None where there is none.

    What is below it is none, see `bt_tasksim.scene.relations.against`.

    Args:
        view: The world.
        target: The thing.
        other: Another object, or a place: then the fixture that it belongs to; by default anything.
    """
    things = things_of(view.world, view.objects)
    mine = [slab for thing in things if thing.name == target for slab in _slabs(thing)]
    if not mine:
        return None
    named = None if other is None else whose(view, other)
    others = [thing for thing in things if thing.name != target and named in (None, thing.name)]
    around = [slab for thing in others for slab in _slabs(thing)]
    ways = [nearest_way(part.outline, wall.outline) for part in mine for wall in beside(mine, around)]
    if not ways:
        return None
    gap, way = min(ways, key=lambda found: round(found[0], 9))
    return Stop(round(gap, 9), np.append(np.round(way, 9), 0.0))


def whose(view: WorldView, name: str) -> str:
    """The name under which an object, or the fixture of a place, is kept clear of."""
    place = view.world.places.get(name)
    return name if place is None else place.fixture or "furniture"


def no_way_named(direction: tuple[float, float, float] | None, other: str | None, by: str) -> str:
    """Why nothing says which way to go, as the end of a sentence; empty where something does.

    Args:
        direction: The direction, if it is given.
        other: The stop, if that is.
        by: Name of the parameter that names it.
    """
    return "" if direction is not None or other is not None else f"give 'direction', '{by}', or both"


def way_in(
    view: WorldView, target: str, direction: tuple[float, float, float] | None, other: str | None
) -> Array | None:
    """The level unit vector ``(3,)`` of a direction; by default that to the nearest wall of something.

    Returns:
        None where there is neither.
    """
    if direction is not None:
        flat = np.array([*direction[:2], 0.0])
        return flat / np.linalg.norm(flat)
    found = None if other is None else nearest_stop(view, target, other)
    return None if found is None else found.towards


def ways_in(
    seen: Seen, target: str, direction: tuple[float, float, float] | None, other: str | None, reach: float
) -> Array:
    """The same in each world ``(N, 3)``.

    Raises:
        NoWayError: Of one world nothing says which way, or the wall is farther away than it may go, metres.
    """
    found = []
    for view in views(seen):
        way = way_in(view, target, direction, other)
        if way is None:
            raise NoWayError(f"{other} has nothing beside {target} that holds it up: give a 'direction'")
        if direction is None and (gap := _gap(view, target, other)) > reach:
            raise NoWayError(
                f"{other} is {1000 * gap:.0f} mm from {target}, farther than it may go, {1000 * reach:.0f} mm"
            )
        found.append(way)
    return constant(np.array(found), seen.tool)


def _gap(view: WorldView, target: str, other: str | None) -> float:
    found = nearest_stop(view, target, other)
    return 0.0 if found is None else found.gap


def _slabs(thing: Thing) -> list[Slab]:
    pieces = thing.pieces if thing.size is None else [box_corners(thing.size)]
    found = []
    for piece in pieces:
        corners = poses.transform(thing.pose, piece)
        found.append(Slab(hull(corners[:, :2]), float(corners[:, 2].min()), float(corners[:, 2].max())))
    return found
