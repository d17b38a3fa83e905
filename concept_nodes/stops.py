"""What holds things up that are slid: the walls beside one, how far away they are, and in which direction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from bt_tasksim.concept_nodes.level_way import flattened
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.poses import Array, constant
from bt_tasksim.core.transfer import fetched
from bt_tasksim.core.world import FURNITURE, Obstacle, WorldModel
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import box_corners
from bt_tasksim.scene.outlines import Slab, hull
from bt_tasksim.scene.walls import Wall, nearest_wall

UP = np.array([0.0, 0.0, 1.0])


FAR = 10.0
"""Metres that things are taken to be apart where there is no wall."""
CLEAR = 0.02
"""Metres from walls from which on a thing is clear of them."""


def nearest_stop(view: WorldView, target: str, other: str | None = None) -> Wall | None:
    """The nearest wall beside a thing, as far as is seen and known, see `bt_tasksim.scene.walls`.

    Args:
        view: The world.
        target: The thing.
        other: Another object, or a place: then the fixture that it belongs to; by default anything.

    Returns:
        None where there is none.
    """
    return _nearest(view.world, view.objects, target, other)


def gaps(world: WorldFacts, objects: Array, target: str, other: str | None) -> Array:
    """Metres ``(N,)`` from a thing to the nearest wall beside it; 0 where they overlap, `FAR` without one.

    Args:
        world: What is known of the worlds.
        objects: Poses ``(N, objects, 7)``: estimated, or true.
        target: The thing.
        other: As of `nearest_stop`.
    """
    found = []
    for k, rows in enumerate(np.asarray(fetched([objects])[0], float)):
        model = world.model_of(k)
        named = {each.name: rows[world.columns[each.name]] for each in model.objects}
        stop = _nearest(model, named, target, other)
        found.append(FAR if stop is None else max(stop.gap, 0.0))
    return constant(np.array(found), objects)


def _nearest(world: WorldModel, objects: Mapping[str, Array], target: str, other: str | None) -> Wall | None:
    """See `nearest_stop`. The outlines of what is not asked about are not made."""
    named = None if other is None else world.thing_of(other)
    walls = [_standing(box) for box in world.obstacles if named in (None, box.fixture or FURNITURE)]
    for name in objects:
        if name != target and named in (None, name):
            walls += _slabs(world, objects, name)
    return nearest_wall(_slabs(world, objects, target), walls)


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
        return flattened(direction)
    found = None if other is None else nearest_stop(view, target, other)
    return None if found is None else found.towards


def ways_in(
    each: Sequence[WorldView],
    target: str,
    direction: tuple[float, float, float] | None,
    other: str | None,
    reach: float,
) -> Array:
    """The same in each of some worlds ``(N, 3)``.

    Raises:
        NoWayError: In one of them nothing says which way, or the wall is farther away than it may go, metres.
    """
    if direction is not None:
        return np.array([flattened(direction)] * len(each))
    found = []
    for view in each:
        stop = None if other is None else nearest_stop(view, target, other)
        if stop is None:
            raise NoWayError(f"{other} has nothing beside {target} that holds it up: give a 'direction'")
        if stop.gap > reach:
            raise NoWayError(
                f"{other} is {1000 * stop.gap:.0f} mm from {target}, farther than it may go, "
                f"{1000 * reach:.0f} mm"
            )
        found.append(stop.towards)
    return np.array(found)


def _slabs(world: WorldModel, objects: Mapping[str, Array], name: str) -> list[Slab]:
    """Parts of an object from above, where it is; none where it was never seen."""
    pose = objects.get(name)
    if pose is None or not bool(np.isfinite(pose).all()):
        return []
    return [_slab(poses.transform(poses.unit_pose(pose), piece)) for piece in pieces_of(world.object(name))]


def _slab(corners: Array) -> Slab:
    return Slab(hull(corners[:, :2]), float(corners[:, 2].min()), float(corners[:, 2].max()))


def _standing(box: Obstacle) -> Slab:
    """A box of furniture from above, which stays as it is."""
    pose = np.asarray(box.pose, float)
    return _box(tuple(pose.tolist()), tuple(box.size))


@lru_cache(maxsize=1024)
def _box(pose: tuple[float, ...], size: tuple[float, float, float]) -> Slab:
    return _slab(poses.transform(np.array(pose), box_corners(size)))
