"""What stands around the robot in one world, as things to keep clear of."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel, WorldModel
from bt_tasksim.planning.things import Thing, box_corners

CLEAR_OF_FURNITURE = 0.008
"""Metres kept from furniture, whose place is calibrated."""
CLEAR_OF_OBJECTS = 0.01
"""Metres kept from objects, beside the uncertainty of their estimates."""


def pieces_of(model: ObjectModel) -> tuple[Array, ...]:
    """Corners ``(n, 3)`` of an object's convex pieces in its own frame, as it is known."""
    if model.solid is None:
        return (box_corners(model.extent),)
    return model.solid.pieces


def things_of(
    world: WorldModel, objects: Mapping[str, Array], closer: float = 0.0, uncertainty: float = 0.0
) -> list[Thing]:
    """Furniture and objects of one world.

    Args:
        world: What is known of it.
        objects: Estimated poses ``(7,)`` of the objects to keep clear of, by name; those that were never seen
            are NaN, and left out.
        closer: Share from 0 to 1 by which one may come closer than usual.
        uncertainty: Metres by which the estimates may be wrong.
    """
    usual = 1.0 - closer
    furniture = [
        Thing(box.fixture or "furniture", box.pose, box.size, margin=usual * CLEAR_OF_FURNITURE)
        for box in world.obstacles
    ]
    margin = usual * (CLEAR_OF_OBJECTS + uncertainty)
    loose = [
        Thing(name, poses.unit_pose(pose), pieces=pieces_of(world.object(name)), margin=margin)
        for name, pose in objects.items()
        if bool(np.isfinite(pose).all())
    ]
    return [*furniture, *loose]
