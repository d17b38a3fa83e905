"""A robot's links as convex parts: what its URDF says that they collide with, each mesh as its hull.

These are the hulls themselves, for questions of a millimetre. Ways are planned with
`bt_tasksim.planning.bodies`, whose hulls have few corners and are up to some millimetres larger for that.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.mesh_hulls import mesh_hull
from bt_tasksim.robot.urdf_visuals import LinkVisual, load_collisions

DEEP = 0.01
"""Metres by which a link may be in furniture, or in another link: a robot stands on something, and hulls are
larger than the links."""


class LinkPart(NamedTuple):
    """A convex part of a link, as coal has it, at ``pose (7,)`` in the link's frame."""

    link: str
    form: Any
    pose: Array


def link_parts(robot: RobotDescription) -> list[LinkPart]:
    """The parts of a robot's links, link by link, made once.

    Raises:
        InputError: A file of its shapes is missing or cannot be read, or a shape is no body.
    """
    found: list[LinkPart] = robot.derived("link parts", _link_parts)
    return found


def _link_parts(robot: RobotDescription) -> list[LinkPart]:
    return [LinkPart(shape.link, _form(shape), np.array(shape.pose)) for shape in load_collisions(robot.urdf)]


def _form(shape: LinkVisual) -> Any:
    """A shape as coal has it."""
    from bt_tasksim.core.convex_hulls import convex
    from bt_tasksim.core.narrow_phase import coal

    match shape.kind:
        case "box":
            return coal.Box(*shape.size)
        case "sphere":
            return coal.Sphere(shape.size[0])
        case "cylinder":
            return coal.Cylinder(*shape.size)
        case _:
            assert shape.mesh is not None
            x, y, z = shape.size
            return convex(mesh_hull(shape.mesh, (x, y, z)))
