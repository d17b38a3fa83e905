"""What stands around the robot in one world, as things to keep clear of."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import FURNITURE, ObjectModel, WorldModel
from bt_tasksim.planning.things import Thing, box_corners

CLEAR_OF_FURNITURE = 0.008
"""Metres kept from furniture, whose place is calibrated."""
CLEAR_OF_OBJECTS = 0.01
"""Metres kept from objects, what estimates are wrong by included: five standard deviations of good ones."""
BORNE = 0.03
"""Metres below an object within which something has to be that bears it, see `adrift`."""


def pieces_of(model: ObjectModel) -> tuple[Array, ...]:
    """Corners ``(n, 3)`` of an object's convex pieces in its own frame, as it is known."""
    if model.solid is None:
        return (box_corners(model.extent),)
    return model.solid.pieces


def things_of(world: WorldModel, objects: Mapping[str, Array], closer: float = 0.0) -> list[Thing]:
    """Furniture and objects of one world.

    Args:
        world: What is known of it.
        objects: Estimated poses ``(7,)`` of the objects to keep clear of, by name; those that were never seen
            are NaN, and left out.
        closer: Share from 0 to 1 by which one may come closer than usual.
    """
    usual = 1.0 - closer
    furniture = [
        Thing(box.fixture or FURNITURE, box.pose, box.size, margin=usual * CLEAR_OF_FURNITURE)
        for box in world.obstacles
    ]
    margin = usual * CLEAR_OF_OBJECTS
    loose = [
        Thing(name, poses.unit_pose(pose), pieces=pieces_of(world.object(name)), margin=margin)
        for name, pose in objects.items()
        if bool(np.isfinite(pose).all())
    ]
    return [*furniture, *loose]


def adrift(things: Sequence[Thing], names: Collection[str]) -> frozenset[str]:
    """Those of some objects that nothing is below: they are not at rest there, but were last seen in motion.

    Boxes about things are compared, so what may be borne counts as borne.

    Args:
        things: Everything that is there.
        names: The objects in question.
    """
    bounds = [_bounds(thing) for thing in things]
    least, most = (np.concatenate(ends) for ends in zip(*bounds, strict=True))
    whose = np.repeat([thing.name for thing in things], [len(ends[0]) for ends in bounds])
    found = set()
    for name in names:
        own = whose == name
        low, high = least[own].min(axis=0) - np.array([0.0, 0.0, BORNE]), most[own].max(axis=0)
        if not ((least < high) & (most > low))[~own].all(axis=-1).any():
            found.add(name)
    return frozenset(found)


def _bounds(thing: Thing) -> tuple[Array, Array]:
    """Least and largest coordinates ``(k, 3)`` of each piece of a thing, robot base frame."""
    pieces = thing.pieces if thing.size is None else [box_corners(thing.size)]
    corners = poses.transform(thing.pose, np.concatenate(pieces))
    first = np.cumsum([0, *(len(piece) for piece in pieces[:-1])])
    return np.minimum.reduceat(corners, first), np.maximum.reduceat(corners, first)
